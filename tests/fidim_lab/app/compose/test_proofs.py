"""Proofs by trial beside a rig file: kept, forgotten after a failure, void for another drive or setting, asked for."""

import asyncio
import math
import re
from dataclasses import replace
from pathlib import Path

import pytest

from drivers.cia402.dictionary import GENERIC_EDS, Graded, Met
from drivers.cia402.dictionary.grading import refusals
from drivers.cia402.dictionary.requirements import Grade, Requirement, met_by_trial
from drivers.disk import InlineDisk
from drivers.ports import Trial
from fidim_lab.app import compose
from fidim_lab.app.compose.proofs import ProofKeeper, held_proofs, void
from fidim_lab.app.compose.winches import winch_configs
from fidim_lab.data.rigs.proof_file import proofs_path, read_proofs
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.errors import SetupError
from procedures.events import StepFinished
from procedures.outcomes import Outcome
from procedures.settings import Settings
from procedures.steps import Result
from procedures.steps.commission import ProveStop

EXAMPLE = Path(__file__).parents[4] / "examples" / "rigs" / "simulated.toml"


@pytest.fixture
def rig(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(EXAMPLE.read_text())
    return path


def finished(trial, outcome=Outcome.PASS, winch=0, serial=77.0, reason="", way=0.0007):
    step = ProveStop(window="w", winch=winch, trial=trial, speed=0.05, acceleration=0.2, watch=1.0)
    readings = {"identity": (1.0, 2.0, 3.0, serial)}
    return StepFinished(0.0, 1, step, Result(outcome, reason, values=(0.031, way), readings=readings), 0.0)


def keep(rig, folder, *events, embedded=False):
    folder.mkdir(exist_ok=True)
    file = replace(read_rig(rig), keeps_homes=not embedded)
    told = []

    async def main():
        keeper = ProofKeeper(file, winch_configs(file), folder, "A. Name", lambda: "now", told.append, InlineDisk())
        for event in events:
            keeper(event)
        await keeper.closed()

    asyncio.run(main())
    assert not told
    return read_proofs(proofs_path(rig, embedded=embedded))


def test_that_a_drive_ended_in_fault_is_kept(rig, tmp_path):
    event = finished(Trial.LOST_HEARTBEAT)
    event = replace(event, result=replace(event.result, readings=event.result.readings | {"faulted": (1.0,)}))
    kept = keep(rig, tmp_path / "run", event, finished(Trial.QUICK_STOP))
    assert {proof.trial: proof.faulted for proof in kept} == {Trial.LOST_HEARTBEAT: True, Trial.QUICK_STOP: False}


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
    assert "no trial 'dance'" in void(proof.model_copy(update={"trial": "dance"}), file, config)
    slower = config.changed(quick_stop_deceleration=1.0)
    assert "6085:0 was" in void(proof, file, slower)
    assert held_proofs(file, slower) == ()
    other = config.changed(serial_number=78)
    assert "serial_number 77, the rig file says 78" in void(proof, file, other)
    assert held_proofs(replace(file, keeps_homes=False), config) == ()  # a rehearsal's drives are others


def test_a_rehearsal_believes_its_own_proofs_and_the_real_rig_does_not(rig, tmp_path):
    rehearsal = replace(read_rig(rig), keeps_homes=False)
    keep(rig, tmp_path / "run", finished(Trial.QUICK_STOP), embedded=True)
    config = winch_configs(rehearsal)[0]
    assert [proof.trial for proof in config.proofs] == [Trial.QUICK_STOP]
    assert read_proofs(proofs_path(rig)) == winch_configs(read_rig(rig))[0].proofs == ()


def test_a_drive_whose_stop_is_neither_told_nor_proven_is_refused_except_in_trials(rig, tmp_path):
    keep(rig, tmp_path / "run", finished(Trial.QUICK_STOP))
    proofs = winch_configs(read_rig(rig))[0].proofs
    wanted = Requirement("quick-stop reaction", Grade.PROVEN, (("605A:0",),), trials=(Trial.QUICK_STOP,))
    assert met_by_trial(wanted, proofs, 77) is not None
    assert met_by_trial(wanted, proofs, 78) is None  # another drive is on the bus
    lacking = (Graded(wanted, Met.ABSENT, "no 605A:0"),)
    assert "fidim commission RIG" in refusals(lacking, on_trial=False)[0]
    assert refusals(lacking, on_trial=True) == []


def without_quick_stop_objects(rig):
    """The rig with drives whose dictionary has neither 605A nor 6085."""
    sections = re.split(r"(?m)^(?=\[)", GENERIC_EDS.read_text())
    left = "".join(part for part in sections if not re.match(r"\[(605A|6085)\]", part))
    (rig.parent / "no_quick_stop.eds").write_text(re.sub(r"(?m)^\d+=0x(605A|6085)\n", "", left))
    rig.write_text(rig.read_text().replace('eds = "generic"', 'eds = "no_quick_stop.eds"'))


def test_a_weaker_quick_stop_that_was_proven_makes_its_winch_slower(rig, tmp_path):
    without_quick_stop_objects(rig)
    full = winch_configs(read_rig(rig))[0]
    assert (full.max_speed, full.proofs) == (read_rig(rig).winches[0].max_speed, ())
    # 0.05 m/s in 5 mm are 0.25 m/s²; the way of a stop goes with the square of the speed
    slower = full.max_speed * math.sqrt(0.25 / full.quick_stop_deceleration)
    keep(rig, tmp_path / "run", finished(Trial.HALT, serial=76.0), finished(Trial.QUICK_STOP, way=0.005))
    first, second, *_ = winch_configs(read_rig(rig))
    assert {proof.trial for proof in first.proofs} == {Trial.QUICK_STOP, Trial.HALT}
    assert first.max_speed == pytest.approx(slower)
    assert second.max_speed == full.max_speed  # of winch 2 nothing is proven
    settings = compose.rig_settings(read_rig(rig))
    assert settings.motion.speed == pytest.approx(min(Settings().motion.speed, slower))
    with pytest.raises(SetupError, match=f"up to {slower:g} m/s"):
        compose.require_what_winches_do(read_rig(rig), replace(settings, motion=replace(settings.motion, speed=0.3)))
    tried_again = winch_configs(read_rig(rig), on_trial=True)[0]
    assert tried_again.max_speed == full.max_speed  # a trial is made at its own speed


def test_a_file_that_is_none_is_named(rig):
    path = proofs_path(rig)
    path.write_text('format = "fidim-proofs/1"\n[[proof]]\nwinch = "winch 1"\n')
    with pytest.raises(SetupError, match=r"proofs\.toml: proof 1, trial: is missing"):
        winch_configs(read_rig(rig))
