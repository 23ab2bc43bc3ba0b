"""Every reader of every kind of file, given what is spoilt in the same ways: one sentence, soon, and no other error."""

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.canbus.candump import read_candump
from drivers.cia402.dictionary import read_family
from drivers.mocap.packet_log import read_packets
from fidim_lab.app.formats.devices_file import read_devices
from fidim_lab.app.formats.explanation_file import read_explanation
from fidim_lab.app.formats.manifest import read_manifest
from fidim_lab.app.formats.run_spec import read_spec
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.design_file import read_design
from fidim_lab.data.importers.grab import read_config, read_log
from fidim_lab.data.importers.mapped_csv import read_mapped
from fidim_lab.data.importers.motive_csv import read_motive
from fidim_lab.data.importers.qtm_tsv import read_qtm
from fidim_lab.data.importers.reading.matlab import load_struct
from fidim_lab.data.importers.trc import read_trc
from fidim_lab.data.importers.vicon_text import read_trajectories
from fidim_lab.data.plan_file import read_plan
from fidim_lab.data.rigs.alignment_file import read_alignment
from fidim_lab.data.rigs.home_file import home_path, read_homes
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.data.robot_file import read_robot
from fidim_lab.data.window_csv import read_window_csv
from fidim_lab.data.window_mcap import read_window_mcap
from fidim_lab.errors import FidimError
from fidim_lab.identification.results.result_file import read_result
from procedures.recording.journal import read_journal
from sim_backends.drive.objects import read_eds

READERS: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "campaign": ("campaign.toml", lambda path: read_campaign(path.parent)),
    "robot": ("robot.toml", read_robot),
    "rig": ("rig.toml", read_rig),
    "home": (home_path(Path("rig.toml")).name, lambda path: read_homes(path.parent / "rig.toml")),
    "plan": ("plan.toml", lambda path: read_plan(path, 4)),
    "alignment": ("alignment.toml", read_alignment),
    "family": ("family.toml", read_family),
    "design": ("design.json", lambda path: read_design(path, 4)),
    "result": ("result.json", read_result),
    "explanation": ("explanation.json", read_explanation),
    "manifest": ("manifest.json", lambda path: read_manifest(path.parent)),
    "devices": ("devices.json", lambda path: read_devices(path.parent)),
    "spec": ("run.json", lambda path: read_spec(path.parent)),
    "csv": ("w.csv", lambda path: read_window_csv(path, 4)),
    "mcap": ("w.mcap", lambda path: read_window_mcap(path, 4)),
    "packets": ("mocap.mcap", lambda path: list(read_packets(path))),
    "candump": ("can.log", lambda path: list(read_candump(path))),
    "mat": ("a.mat", lambda path: load_struct(path, "s")),
    "trajectories": ("a.txt", read_trajectories),
    "motive": ("a.csv", read_motive),
    "qtm": ("a.tsv", read_qtm),
    "trc": ("a.trc", read_trc),
    "columns": ("map.toml", lambda path: read_mapped(path.parent / "take.csv", path)),
    "grab config": ("c.json", lambda path: read_config(path, np.zeros((5, 3)))),
    "grab log": ("r.log", lambda path: read_log(path, 4)),
    "eds": ("a.eds", lambda path: read_eds(path, 3)),
    "journal": ("journal.jsonl", read_journal),
}

SPOILT: dict[str, Callable[[Path], object]] = {
    "fifo": os.mkfifo,
    "folder": Path.mkdir,
    "no end": lambda path: path.symlink_to("/dev/zero"),
    "loop": lambda path: path.symlink_to(path.name),
    "utf-16": lambda path: path.write_bytes('format = "x"\n'.encode("utf-16") * 2),
    "lists": lambda path: path.write_bytes(b"a = [" + b"[" * 200_000 + b"\n"),
    "objects": lambda path: path.write_bytes(b'{"a":' * 100_000 + b"\n\n"),
    "digits": lambda path: path.write_bytes(b"a = " + b"9" * 9_000 + b"\n\n"),
    "escape": lambda path: path.write_bytes(b'"\x1b[2J\x1b]0;x\x07" = "\\u202e"\n\n'),
    "long name": lambda path: path.write_bytes(b'"' + b"a" * 50_000 + b'" = 1\n\n'),
    "zeros": lambda path: path.write_bytes(bytes(100_000)),
}


@pytest.mark.parametrize("spoil", SPOILT)
@pytest.mark.parametrize("kind", READERS)
def test_one_sentence(tmp_path: Path, kind: str, spoil: str) -> None:
    name, read = READERS[kind]
    SPOILT[spoil](tmp_path / name)
    if kind == "journal" and (tmp_path / name).is_file() and spoil != "no end":
        (tmp_path / name).write_bytes((tmp_path / name).read_bytes() + b"x\n")  # else it is a torn last line
    if (kind, spoil) in {("journal", "zeros"), ("home", "loop"), ("alignment", "loop")}:
        return  # zeros are what a power cut leaves of a last line; a loop is no file, and these two may be missing
    began = time.process_time()
    with pytest.raises(FidimError) as caught:
        read(tmp_path / name)
    assert caught.value.exit_code == 2
    assert len(str(caught.value)) < 500
    assert time.process_time() - began < 5.0
