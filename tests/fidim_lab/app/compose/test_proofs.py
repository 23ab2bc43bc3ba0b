"""Proofs by trial beside a rig file: kept, forgotten after a failure, void for another drive or setting, asked for."""

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest

from drivers.cia402.grading import refusals
from drivers.cia402.requirements import Grade, Graded, Met, Requirement, met_by_trial
from drivers.disk import InlineDisk
from drivers.ports import Trial
from fidim_lab.app.compose.proofs import ProofKeeper, held_proofs, void
from fidim_lab.app.compose.real import winch_configs
from fidim_lab.data.rigs.proof_file import proofs_path, read_proofs
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.errors import SetupError
from procedures.events import StepFinished
from procedures.outcomes import Outcome
from procedures.steps import Result
from procedures.steps.commission import ProveStop

EXAMPLE = Path(__file__).parents[4] / "examples" / "rigs" / "simulated.toml"


@pytest.fixture
def rig(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(EXAMPLE.read_text())
    return path


def finished(trial, outcome=Outcome.PASS, winch=0, serial=77.0, reason=""):
    step = ProveStop(window="w", winch=winch, trial=trial, speed=0.05, acceleration=0.2, watch=1.0)
    readings = {"identity": (1.0, 2.0, 3.0, serial)}
    return StepFinished(0.0, 1, step, Result(outcome, reason, values=(0.031, 0.0007), readings=readings), 0.0)


def keep(rig, folder, *events):
    folder.mkdir(exist_ok=True)
    file = read_rig(rig)
    told = []

    async def main():
        keeper = ProofKeeper(file, winch_configs(file), folder, "A. Name", lambda: "now", told.append, InlineDisk())
        for event in events:
            keeper(event)
        await keeper.closed()

    asyncio.run(main())
    assert not told
    return read_proofs(proofs_path(rig))


def test_what_passes_is_kept_and_what_fails_is_forgotten(rig, tmp_path):
    halt, quick = finished(Trial.HALT), finished(Trial.QUICK_STOP)
    kept = keep(rig, tmp_path / "one", quick, halt, finished(Trial.LOST_SYNC, Outcome.FAIL, reason="does not stop"))
    assert [(proof.winch, proof.trial) for proof in kept] == [("winch 1", "quick stop"), ("winch 1", "halt")]
    assert (kept[0].serial_number, kept[0].time, kept[0].distance, kept[0].by) == (77, 0.031, 0.0007, "A. Name")
    assert kept[0].settings["605A:0"] == 6
    kept = keep(rig, tmp_path / "two", finished(Trial.HALT, Outcome.FAIL), finished(Trial.QUICK_STOP, winch=1))
    assert [(proof.winch, proof.trial) for proof in kept] == [("winch 1", "quick stop"), ("winch 2", "quick stop")]
    assert len(read_proofs(tmp_path / "two" / "proofs.toml")) == 1  # of this run alone


def test_a_proof_holds_for_its_drive_and_settings(rig, tmp_path):
    (proof,) = keep(rig, tmp_path / "run", finished(Trial.QUICK_STOP))
    file = read_rig(rig)
    config = winch_configs(file)[0]
    assert [(found.trial, found.serial_number) for found in config.proofs] == [(Trial.QUICK_STOP, 77)]
    assert void(proof, file, config) == ""
    assert "no trial 'dance'" in void(replace(proof, trial="dance"), file, config)
    slower = replace(config, quick_stop_deceleration=1.0)
    assert "6085:0 was" in void(proof, file, slower)
    assert held_proofs(file, slower) == ()
    other = replace(config, serial_number=78)
    assert "serial_number 77, the rig file says 78" in void(proof, file, other)
    assert held_proofs(replace(file, keeps_homes=False), config) == ()  # a rehearsal's drives are others


def test_a_drive_whose_stop_is_neither_told_nor_proven_is_refused_except_in_trials(rig, tmp_path):
    keep(rig, tmp_path / "run", finished(Trial.QUICK_STOP))
    proofs = winch_configs(read_rig(rig))[0].proofs
    wanted = Requirement("quick-stop reaction", Grade.PROVEN, (("605A:0",),), trials=(Trial.QUICK_STOP,))
    assert met_by_trial(wanted, proofs, 77) is not None
    assert met_by_trial(wanted, proofs, 78) is None  # another drive is on the bus
    lacking = (Graded(wanted, Met.ABSENT, "no 605A:0"),)
    assert "fidim commission RIG" in refusals(lacking, on_trial=False)[0]
    assert refusals(lacking, on_trial=True) == []


def test_a_file_that_is_none_is_named(rig):
    path = proofs_path(rig)
    path.write_text('format = "fidim-proofs/1"\n[[proof]]\nwinch = "winch 1"\n')
    with pytest.raises(SetupError, match=r"proofs\.toml: proof 1, trial: is missing"):
        winch_configs(read_rig(rig))
