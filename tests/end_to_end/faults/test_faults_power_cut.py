"""A power cut at any step: what was not brought to the disk is gone, and the run goes on from what is there."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Role
from procedures.events import StepFinished, StepStarted
from procedures.outcomes import Outcome
from procedures.protocols import catalogue
from procedures.recording.journal import LineKind, read_journal
from procedures.recording.resumption import read_resumption

ROLES = {"i01": Role.IDENTIFY, "i02": Role.IDENTIFY}


@dataclass
class Platter:
    """What the disk really has: contents as of each file's last fsync, names as of the folder's or the file's own."""

    root: Path
    contents: dict[int, bytes] = field(default_factory=dict)
    """by inode"""
    names: dict[Path, int] = field(default_factory=dict)

    def synced(self, descriptor: int) -> None:
        path = Path(f"/proc/self/fd/{descriptor}").readlink()
        if not path.is_relative_to(self.root):
            return
        if path.is_dir():
            for name in [name for name in self.names if name.parent == path]:
                del self.names[name]
            self.names |= {child: child.stat().st_ino for child in path.iterdir() if child.is_file()}
        else:
            inode = path.stat().st_ino
            self.contents[inode] = path.read_bytes()
            self.names[path] = inode

    def cut(self, to: Path) -> Path:
        """The folder as it is found when the power is back."""
        for path, inode in self.names.items():
            there = to / path.relative_to(self.root)
            there.parent.mkdir(parents=True, exist_ok=True)
            there.write_bytes(self.contents.get(inode, b""))
        for folder in ("windows", "rejected"):
            (to / folder).mkdir(parents=True, exist_ok=True)
        return to


@contextmanager
def platter(root: Path) -> Iterator[Platter]:
    """Listens to fsync."""
    really, disk = os.fsync, Platter(root)

    def fsync(descriptor: int) -> None:
        really(descriptor)
        disk.synced(descriptor)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", fsync)
        yield disk


@pytest.mark.fault(
    "disk",
    "the power is cut at any step: what was not synced is gone",
    reaction="`fidim resume` goes on",
    says="what has its verdict stays",
    window="recorded again",
)
def test_a_power_cut(scene):
    rehearsal = scene.make()
    rehearsal.plan = scene.two
    rehearsal.at("Record", lambda stage: None)
    cuts: list[tuple[str, Path, list[str]]] = []
    with platter(rehearsal.folder) as disk:

        def cut(event):
            if isinstance(event, StepStarted | StepFinished):
                name = f"cut-{len(cuts):02d}-{type(event).__name__}-{type(event.step).__name__}"
                told = [e.window for e in read_journal(disk.root / "journal.jsonl") if verdict(e)]
                cuts.append((name, disk.cut(scene.path / name), told))

        rehearsal.listeners = (cut,)
        whole = rehearsal.run()
    whole.check()
    assert [row.id for row in whole.report.accepted] == ["i01", "i02"]
    for name, folder, told in cuts:
        resumption = read_resumption(folder, ROLES)
        assert [entry.id for entry in resumption.entries][: len(told)] == told, name
        kept = resumption.entries and read_campaign(folder).windows
        assert {len(window.t) for window in kept} <= {whole.rows}, name
    assert {tuple(told) for _, _, told in cuts} == {(), ("i01",), ("i01", "i02")}
    goes_on(scene, next(folder for name, folder, _ in cuts if name.endswith("StepStarted-MoveTo")), ["i01", "i02"], {})
    later = next(folder for name, folder, told in cuts if told == ["i01"] and name.endswith("StepStarted-Record"))
    goes_on(scene, later, ["i01", "i02"], {"place": None})  # the simulated robot stands elsewhere


def verdict(entry) -> bool:
    return entry.kind is LineKind.STEP_FINISHED and entry.step == "Accept"


def goes_on(scene, folder: Path, windows: list[str], changes) -> None:
    resumption = replace(read_resumption(folder, ROLES), **changes)
    again = scene.make(folder=folder.name)
    again.plan = scene.two
    again.at("Record", lambda stage: None)
    experiment = catalogue.experiment("identify", scene.two, scene.robot, again.settings, resumption=resumption)
    report = again.run(experiment, resumption=resumption).report
    assert (report.outcome, report.held) == (Outcome.PASS, True)
    assert [window.id for window in read_campaign(folder).windows] == windows
    shutil.rmtree(folder)
