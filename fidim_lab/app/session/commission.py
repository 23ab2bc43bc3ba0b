"""`fidim commission`: prove every stop of a rig's drives by trial, without load, with a person there.

A procedure like others, carried out by a service that owns the rig: its journal, its guards, its emergency stop.
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fidim_lab.app.formats.answer_file import write_summary
from fidim_lab.app.formats.run_spec import RunSpec
from fidim_lab.app.service.main import prepare
from fidim_lab.app.service.place import place_of
from fidim_lab.app.session.after_run import advise
from fidim_lab.app.session.left_holding import left_by, power_advice
from fidim_lab.app.session.run_process import start_and_watch
from fidim_lab.app.session.undo_stop import confirmed
from fidim_lab.app.terminal import console
from fidim_lab.data.plan_file import write_plan
from fidim_lab.data.records import Plan, PlannedWindow, Role
from fidim_lab.data.rigs.proof_file import proofs_path, read_proofs
from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.errors import SetupError
from procedures.protocols.listing import Outline
from procedures.recording.run_folder import free_folder, require_new

PROCEDURE = "commission"


@dataclass(frozen=True)
class CommissionOptions:
    """As on the command line."""

    rig: Path
    by: str
    out: Path | None
    embedded: bool
    listing: bool
    seed: int = 1
    json_file: Path | None = None


def commission_command(options: CommissionOptions) -> int:
    """Try, and keep what was proven; returns the run's exit code. Raises FidimError before anything has moved."""
    if not options.listing and not options.by.strip():
        raise SetupError(
            "--by is missing: somebody must be at the robot while its stops are tested.",
            hint='Give --by "A. Name".',
        )
    file = read_rig(options.rig)
    out = (options.out or free_folder(f"commission-{options.rig.stem}")).absolute()
    with tempfile.TemporaryDirectory(prefix="fidim-commission-") as folder:
        plan = Path(folder) / "plan.toml"
        write_plan(plan, winch_plan(file))
        spec = RunSpec(
            plan=plan,
            rig=options.rig.absolute(),
            out=out,
            procedure=PROCEDURE,
            embedded=options.embedded,
            seed=options.seed,
            by=options.by.strip(),
        )
        if options.listing:
            console.out.print(Outline(prepare(spec).experiment.procedure).text(), end="", markup=False)
            return 0
        require_new(out)
        place = place_of(prepare(spec).file, embedded=spec.embedded)
        left = left_by(place)
        code = start_and_watch(spec, place, confirmed(spec))
    advise(spec, code, power_advice(out, options.rig, left))
    path = proofs_path(options.rig, embedded=options.embedded)
    of = "trials of the simulated drives passed" if options.embedded else "trials passed"
    console.out.print(f"proofs      {path}: {len(read_proofs(path))} {of}", markup=False, soft_wrap=True)
    write_summary(options.json_file, out, code)
    return code


def winch_plan(file: RigFile) -> Plan:
    """A window for each winch, of its name; its lengths are only where an embedded robot rests."""
    lengths = np.array([float(np.mean(winch.length_limits)) for winch in file.winches])
    windows = [
        PlannedWindow(_id(winch.name), Role.IDENTIFY, lengths, displacement=np.zeros(2), position=np.zeros(3))
        for winch in file.winches
    ]
    return Plan(f"stops of {file.name}", tuple(windows))


def _id(name: str) -> str:
    """A winch's name as the id of a window, which may be the name of a file."""
    return "".join(letter if letter.isalnum() else "-" for letter in name)
