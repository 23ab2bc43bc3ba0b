"""The benchmark of separation: what counts as right, sizes that leave a pair open, rows that are kept."""

import json
from concurrent.futures import Future
from dataclasses import asdict, replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import separate
from benchmarks.sealed.sizes import EFFECTS
from benchmarks.separate import FAINT, carry_out, hidden_keys, non_centrality, outcome, pairs, read, separated
from benchmarks.separate_page import EVIDENT, Row, report
from fidim_lab.identification.random_plan import random_plan

PAIR = ("rotational-drag", "swivel-damping")


def told(*effects):
    causes = tuple(SimpleNamespace(id=id, equivalent_to=alike) for id, *alike in effects)
    return SimpleNamespace(effects=causes)


@pytest.mark.parametrize(
    ("effects", "says"),
    [
        ([("rotational-drag",)], "right"),
        ([("rotational-drag", "swivel-friction")], "right"),
        ([("rotational-drag", "swivel-damping")], "alike"),
        ([("swivel-damping", "rotational-drag")], "alike"),
        ([("air-drag-linear",), ("swivel-damping",)], "wrong"),
        ([("air-drag-linear", "rotational-drag")], "right"),
        ([("air-drag-linear", "swivel-damping")], "wrong"),
        ([("air-drag-linear",)], "else"),
        ([], "else"),
    ],
)
def test_what_is_right(effects, says):
    assert outcome(told(*effects), *PAIR) == says


def test_every_pair_of_the_list_of_equivalences_can_be_hidden():
    assert len(pairs()) >= 12
    assert all(id in EFFECTS for pair in pairs() for id in pair)


def test_the_size_leaves_the_pair_open(irma4):
    windows = random_plan(irma4, "short", 2, 1, 4).windows
    keys, size = hidden_keys(irma4, *PAIR, windows, np.random.default_rng(3))
    spec = EFFECTS["rotational-drag"]
    assert keys == {"c": size}
    left, seen = non_centrality(irma4, *PAIR, keys, windows)
    assert left < seen
    faint, evident = left <= 1.01 * FAINT[1], seen >= 0.99 * EVIDENT
    barely = seen == pytest.approx(EVIDENT, rel=0.02)
    assert evident or size == spec.high
    assert faint or barely or size == spec.low, "larger than faint only as far as it takes to be seen"


def row(trial, before, promised=None, after="", recorded=False):
    return Row(PAIR, trial, PAIR[0], 0.01, before, promised, 2, recorded, "", after, 30.0)


def test_the_table_counts_what_was_promised_and_what_was_kept():
    rows = [
        row(0, "right"),
        row(1, "alike", 0.95, "right", True),
        row(2, "alike", 0.97, "wrong", True),
        row(3, "alike", 0.6, "alike", True),
        row(4, "alike", 0.1),
        row(5, "else"),
    ]
    said = report(rows)
    assert "| rotational-drag / swivel-damping | 6 | 1 | 4 | 1/2 | 0/1 | 1 | 1 | 1 | 1 |" in said
    assert "Where ≥ 90 % were promised: right in 1/2 = 50.0 %" in said
    assert "(60 % on average)" in said
    assert "rotational-drag (0.01) called swivel-damping after 2 windows with 97 % promised: trial 2" in said


def test_trials_that_were_made_are_not_made_again(tmp_path, monkeypatch, capsys):
    rows = tmp_path / "rows.jsonl"
    rows.write_text(json.dumps(asdict(row(0, "right"))) + "\n")

    class Here:
        def __init__(self, _): ...
        def __enter__(self):
            return self

        def __exit__(self, *_): ...
        def submit(self, work, *arguments):
            done = Future()
            try:
                done.set_result(work(*arguments))
            except ValueError as bug:
                done.set_exception(bug)
            return done

    monkeypatch.setattr(separate, "ProcessPoolExecutor", Here)
    monkeypatch.setattr(separate, "as_completed", iter)

    def made(_pair, trial, _seed):
        if trial == 2:
            raise ValueError("a bug")
        return replace(row(trial, "else"), says="made")

    monkeypatch.setattr(separate, "run", made)
    carry_out([(PAIR, 0), (PAIR, 1), (PAIR, 2), (PAIR, 3)], rows, 1, 1)
    assert [(one.trial, one.says) for one in read(rows)] == [(0, ""), (1, "made"), (3, "made")]
    assert "ValueError: a bug" in capsys.readouterr().out


def claim(id, *rivals):
    return SimpleNamespace(id=id, cable=None, rivals=rivals)


@pytest.mark.parametrize(("beyond", "promised"), [((), 0.95), (("swivel-damping",), 0.0)])
def test_proposals_are_recorded_while_something_is_open(irma4, monkeypatch, beyond, promised):
    """First two others are open, then the pair, then it is clear; windows add up to no more than MORE."""
    states = [
        told(("air-drag-linear", "swivel-friction")),
        told(("swivel-damping", "rotational-drag")),
        told(("rotational-drag",)),
    ]
    for state in states:
        state.chi2_per_dof, state.parameters, state.verdict = SimpleNamespace(after=1.0), {}, SimpleNamespace(value="")
        for cause in state.effects:
            cause.cable = None
    asked = []

    def proposed(_campaign, claims, _body, *, more, **_):
        asked.append((sorted(c.id for c in claims), more))
        odds = SimpleNamespace(probability=0.95)
        return [SimpleNamespace(claim=c, windows=("w",), after=(odds,), beyond=beyond, says="told.") for c in claims]

    monkeypatch.setattr(separate, "as_file", lambda state: state)
    monkeypatch.setattr(separate, "claims_of", lambda s: [claim(e.id, *e.equivalent_to) for e in s.effects])
    monkeypatch.setattr(separate, "to_separate", proposed)
    monkeypatch.setattr(separate, "planned", lambda _robot, number, _trial: f"more{number}")
    monkeypatch.setattr(separate, "explain", lambda recorded: states[len(recorded) - 3])
    campaign = SimpleNamespace(robot=irma4)

    class Recorded(tuple):
        robot = irma4

    begin = Row(PAIR, 0, PAIR[0], 0.01, "else")
    found = separated(begin, campaign, states[0], PAIR, Recorded, ("a", "b", "c"))
    assert asked == [(["air-drag-linear"], 4), (["swivel-damping"], 3)]
    assert (found.after, found.windows, found.recorded, found.promised) == ("right", 2, True, promised)
