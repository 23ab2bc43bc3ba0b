"""What periods show of a pendulum: against the textbook, the independent plant, and what is wrong with them."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.identification.period_coverage import ROBOTS, errors
from fidim_lab.data.records import PARAMETER_NAMES, Body, Campaign, Period, Robot
from fidim_lab.data.robot_file import read_robot
from fidim_lab.errors import RefusedError, SetupError
from fidim_lab.identification.equations.consistency import can_exist
from fidim_lab.identification.mle.periods.by_periods import identify_by_periods
from fidim_lab.identification.results.result import IdentificationResult, ResultOutcome
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.many_swings import MOTIONS, ManyRests, many_swings, tilts
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.modes import modes

HIGH, LOW = (2.38, 2.38), (1.88, 1.93)


@pytest.fixture(scope="module")
def bifilar() -> Robot:
    """The example."""
    return read_robot(ROBOTS / "bifilar.toml")


def another(robot: Robot) -> Body:
    """A body 10 to 20 % off the robot file's."""
    return Body(
        robot.nominal.com * 1.12 + np.array([2e-3, 1e-3, 0.0]), robot.nominal.inertia * [1.12, 0.9, 1.15, 1, 1, 1]
    )


def timed(robot: Robot, body: Body, *, level: float | None = 2e-3) -> tuple[Period, ...]:
    """All swings at two lengths, exactly, by someone who is good to 0.1 s in 20 swings."""
    mechanism, found = Mechanism(robot), list[Period]()
    for lengths in (HIGH, LOW):
        rest = pose_from_lengths(mechanism, body, np.array(lengths))
        swings = many_swings(mechanism, body.vector[np.newaxis], np.array([lengths]), ManyRests.all_at(rest, 1))
        tilt = None if level is None else (*map(float, tilts(robot, swings.rests)[0]), level)
        for period, shares in zip(np.exp(swings.log_periods[0]), swings.shares[0].T, strict=True):
            motion = list(MOTIONS)[int(np.argmax(shares))]
            found.append(Period(np.array(lengths), motion, 20 * float(period), 20, 0.1, 0.0, tilt))
    return tuple(found)


def identified(robot: Robot, periods: tuple[Period, ...]) -> IdentificationResult:
    """The answer."""
    return identify_by_periods(Campaign("pendulum", robot, 0.0, (), periods=periods))


def within(result: IdentificationResult, truth: Body, sd: float = 3.0) -> None:
    """Every parameter that is seen is right, and the body can exist."""
    for k, (name, p) in enumerate(result.parameters.items()):
        assert not p.seen or abs(p.value - truth.vector[k]) < sd * p.sd, name
    assert can_exist(result.body)


def seen(result: IdentificationResult) -> set[str]:
    """Names."""
    return {name for name, p in result.parameters.items() if p.seen}


def test_many_swings_are_those_of_one(bifilar: Robot) -> None:
    mechanism, rng = Mechanism(bifilar), np.random.default_rng(3)
    near = pose_from_lengths(mechanism, bifilar.nominal, np.array(LOW))
    bodies = bifilar.nominal.vector * (1 + 0.1 * rng.normal(size=(5, 9))) + 5e-3 * rng.normal(size=(5, 9))
    found = many_swings(mechanism, bodies, np.tile(LOW, (5, 1)), ManyRests.all_at(near, 5))
    for k, body in enumerate(map(Body.from_vector, bodies)):
        one = modes(mechanism, body, pose_from_lengths(mechanism, body, np.array(LOW)))
        assert np.exp(-found.log_periods[k]) == pytest.approx(one.frequencies, rel=1e-7)
    assert found.hangs.all()
    assert np.all(np.abs(found.shares.sum(axis=1) - 1) < 0.05)


def test_yaw_alone_shows_the_inertia_of_the_textbook_and_nothing_else(bifilar: Robot) -> None:
    inertia, hangs, above, below = 0.048, 2.0, 0.30, 0.25
    value = 2 * np.pi * np.sqrt(inertia * hangs / (9.81 * above * below))
    cord = np.full(2, np.hypot(hangs, above - below))
    result = identified(bifilar, (Period(cord, "yaw", 50 * value, 50, 0.05, 0.0, (0.0, 0.0, 2e-3)),))
    assert result.outcome is ResultOutcome.DOUBTFUL
    assert seen(result) <= {"s_y", "I_zz"}
    assert "I_zz" in seen(result)
    found = result.parameters["I_zz"]
    assert abs(found.value - inertia) < 2 * found.sd
    assert found.sd < 0.05 * inertia
    assert any("do not determine" in warning for warning in result.warnings)


def test_all_swings_at_two_lengths_with_and_without_a_level(bifilar: Robot) -> None:
    truth = another(bifilar)
    levelled, bare = (identified(bifilar, timed(bifilar, truth, level=level)) for level in (2e-3, None))
    assert {"s_y", "s_z", "I_xx", "I_zz"} <= seen(levelled)
    for result in (levelled, bare):
        assert result.outcome is ResultOutcome.DOUBTFUL
        within(result, truth)
        assert result.seconds < 20
    assert levelled.parameters["s_z"].sd < 6e-3
    assert levelled.parameters["s_y"].sd < 1e-3
    assert bare.parameters["s_y"].sd > 5e-3


def test_bodies_of_other_kind_with_the_same_periods_are_all_told(bifilar: Robot) -> None:
    """Nobody says which of the two swings is yaw, and a light body that rocks as a heavy one yaws has them as well."""
    result = identified(bifilar, tuple(Period(np.array(HIGH), "", 20 * t, 20, 0.1, 0.0) for t in (3.05, 2.45)))
    assert result.outcome is ResultOutcome.UNSEEN
    assert any("different bodies have these periods" in warning for warning in result.warnings)
    named = identified(bifilar, (Period(np.array(HIGH), "yaw", 49.0, 20, 0.1, 0.0),))
    assert "I_zz" in seen(named)
    assert not any("different bodies" in warning for warning in named.warnings)


def test_motions_that_nobody_named_are_found_by_their_periods(bifilar: Robot) -> None:
    truth = another(bifilar)
    result = identified(bifilar, tuple(replace(one, motion="") for one in timed(bifilar, truth)))
    assert result.outcome.answers, result.answer.message
    within(result, truth)
    assert {"s_z", "I_zz"} <= seen(result)


def test_a_swing_too_few_and_exchanged_motions_are_told(bifilar: Robot) -> None:
    periods = timed(bifilar, another(bifilar))
    yaw = next(k for k, one in enumerate(periods) if one.motion == "yaw")
    along = next(k for k, one in enumerate(periods) if one.motion == "along")
    one_short = replace(periods[yaw], swings=19)
    found = identified(bifilar, (*periods[:yaw], one_short, *periods[yaw + 1 :]))
    assert found.outcome is ResultOutcome.MISFIT
    assert f"20 swings instead of 19 in period {yaw + 1}" in found.answer.verdict
    names = {yaw: "along", along: "yaw"}
    found = identified(bifilar, tuple(replace(one, motion=names.get(k, one.motion)) for k, one in enumerate(periods)))
    assert found.outcome is ResultOutcome.MISFIT
    assert "exchanged" in found.answer.verdict


@pytest.mark.parametrize(("factor", "said"), [(0.5, "one way and back"), (2.0, "every second"), (1e3, "not in ms")])
def test_half_double_and_milliseconds_are_refused(bifilar: Robot, factor: float, said: str) -> None:
    with pytest.raises(RefusedError, match="Period 1") as refused:
        identified(bifilar, (Period(np.array(HIGH), "yaw", 2.65 * factor, 1, 1e-3),))
    assert said in refused.value.hint


def test_lengths_without_rest_and_swings_that_there_are_not(bifilar: Robot) -> None:
    with pytest.raises(SetupError, match="Period 1, lengths"):
        identified(bifilar, (Period(np.array([0.02, 0.02]), "yaw", 2.6, 1, 1e-3),))
    trifilar = read_robot(ROBOTS / "trifilar.toml")
    with pytest.raises(RefusedError, match="no swing at these lengths is rock"):
        identified(trifilar, (Period(np.full(3, 2.0), "rock", 1.4, 1, 1e-3),))


def test_more_different_periods_than_there_are_swings_are_refused(bifilar: Robot) -> None:
    scattered = tuple(Period(np.array(HIGH), "yaw", 20 * (2.5 + 0.05 * k), 20, 0.1, 0.05, None) for k in range(6))
    with pytest.raises(SetupError, match=r"6 different ones, 2\.5 s \(yaw\).* the body has 4 swings there"):
        identified(bifilar, scattered)


@pytest.mark.parametrize("seed", [5, 6, 7])
@pytest.mark.sampled(1)
def test_periods_that_no_body_has_are_told_and_never_break_anything(bifilar: Robot, seed: int) -> None:
    """They drive the search to bodies without thickness, or to where they hardly hang."""
    rng = np.random.default_rng(seed)
    usual = {"": 3.0, "yaw": 2.5, "along": 3.05, "across": 3.2, "rock": 1.3}
    for _ in range(4):
        periods: list[Period] = []
        for _ in range(4):
            motion = str(rng.choice(list(usual)))
            time = 20 * usual[motion] * float(np.exp(0.15 * rng.normal()))
            periods.append(Period(np.array(HIGH if rng.random() < 0.5 else LOW), motion, time, 20, 0.02, 0.0, None))
        try:
            found = identified(bifilar, tuple(periods))
        except (RefusedError, SetupError):
            continue
        assert np.isfinite(found.body.vector).all()
        assert found.outcome is not ResultOutcome.CONVERGED


def test_swings_that_the_independent_plant_makes_are_within_their_errors(capsys: pytest.CaptureFixture[str]) -> None:
    found = dict(zip(PARAMETER_NAMES, errors(4, "bifilar", level=True, lengths=1), strict=True))
    assert capsys.readouterr().out
    known = {name: value for name, value in found.items() if np.isfinite(value)}
    assert {"s_z", "I_zz"} <= set(known)
    assert max(map(abs, known.values())) < 3.5
