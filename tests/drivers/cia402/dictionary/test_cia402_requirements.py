"""Requirements in grades: the one list, and where proofs by trial are looked up."""

from dataclasses import replace
from pathlib import Path

from drivers.cia402.dictionary import TrialPassed
from drivers.cia402.dictionary.requirements import REQUIREMENTS, Grade, Trial, met_by_trial


def proof(trial: Trial, serial_number: int = 7, at: str = "2026-11-25T10:00:00") -> TrialPassed:
    return TrialPassed(trial, serial_number, speed=0.02, time=0.1, distance=1e-3, by="A. Name", at=at)


def test_what_is_to_be_proven_has_a_trial_and_nothing_else_has():
    for requirement in REQUIREMENTS:
        assert bool(requirement.trials) == (requirement.grade is Grade.PROVEN), requirement.key


def test_a_proof_counts_for_its_trial_and_its_drive():
    lost = next(r for r in REQUIREMENTS if Trial.LOST_SYNC in r.trials)
    assert met_by_trial(lost, [proof(Trial.LOST_SYNC)], 7) == proof(Trial.LOST_SYNC)
    assert met_by_trial(lost, [proof(Trial.LOST_SYNC)], 8) is None, "another drive was tried"
    assert met_by_trial(lost, [proof(Trial.HALT)], 7) is None
    newer = proof(Trial.LOST_HEARTBEAT, at="2026-11-26T10:00:00")
    assert met_by_trial(lost, [newer, proof(Trial.LOST_SYNC)], 7) is newer


def test_a_fault_reaction_is_proven_where_a_drive_ended_in_fault_by_itself():
    reaction = next(r for r in REQUIREMENTS if r.key == "fault reaction")
    quiet, faulted = proof(Trial.LOST_HEARTBEAT), replace(proof(Trial.LOST_HEARTBEAT), faulted=True)
    assert met_by_trial(reaction, [quiet], 7) is None
    assert met_by_trial(reaction, [quiet, faulted], 7) is faulted
    quick = next(r for r in REQUIREMENTS if r.key == "quick-stop reaction")
    assert met_by_trial(quick, [faulted], 7) is None


def test_the_page_for_people_has_the_same_table():
    page = (Path(__file__).parents[4] / "docs" / "rig.md").read_text(encoding="utf-8")
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in page.splitlines() if line.startswith("| ")
    ]
    table = {row[0]: row for row in rows if len(row) == 4 and row[2] in list(Grade)}
    assert list(table) == [requirement.key for requirement in REQUIREMENTS]
    for requirement in REQUIREMENTS:
        _, _, grade, instead = table[requirement.key]
        trials = f"trial: {', or '.join(requirement.trials)}" if requirement.trials else ""
        trials += ", or a lost host that ends in fault" if requirement.by_fault else ""
        assert grade == requirement.grade
        assert instead == ("; ".join(filter(None, (trials, requirement.instead))) or "refused")
