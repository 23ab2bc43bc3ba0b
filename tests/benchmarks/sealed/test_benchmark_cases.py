"""What is hidden: in fixed shares, over the whole catalogue, from the number alone; and in robots that are robots."""

from collections import Counter

import numpy as np
import pytest

from benchmarks.sealed.cases import DECK, NOT_TOGETHER, SecretKind, case_of, lacking
from benchmarks.sealed.robots import about_vertical, random_setup
from benchmarks.sealed.sizes import EFFECTS, OUTSIDE, SIZES
from fidim_lab.data.robot_file import read_robot, write_robot
from fidim_lab.effects.catalogue import catalogue
from sim_backends.plant.hidden import CATALOGUE, parse_effect
from sim_backends.plant.outside import OUTSIDE as OUTSIDE_KINDS
from sim_backends.plant.world import exists

MANY = [case_of(7, number, 11.0, 4) for number in range(1, 301)]


def test_sizes_are_given_for_the_whole_catalogue_and_all_that_is_outside(irma4_file):
    ids = {effect.id for effect in catalogue(read_robot(irma4_file))}
    assert ids == {*EFFECTS, "sensor-fault", "unknown"} == set(CATALOGUE)
    assert set(OUTSIDE) == {"unknown", *OUTSIDE_KINDS}


def test_shares_are_those_of_the_issue():
    kinds = Counter(case.kind for case in MANY)
    assert kinds == {kind: 5 * count for kind, count in DECK.items()}
    effects = kinds[SecretKind.ONE] + kinds[SecretKind.TWO] + kinds[SecretKind.THREE]
    assert kinds[SecretKind.TWO] / effects == pytest.approx(1 / 3, abs=0.01)
    assert kinds[SecretKind.THREE] / effects == pytest.approx(1 / 10, abs=0.01)
    assert min(kinds[SecretKind.NOTHING], kinds[SecretKind.OUTSIDE]) >= 30


def test_every_effect_comes_about_equally_often():
    counts = Counter(hidden.id for case in MANY for hidden in case.effects)
    assert {*EFFECTS, "sensor-fault"} <= set(counts) <= set(SIZES)
    of_catalogue = [counts[id] for id in EFFECTS]
    assert max(of_catalogue) - min(of_catalogue) <= 5


def test_no_two_alike_stand_together():
    for case in MANY:
        ids = [hidden.id for hidden in case.effects]
        assert len(set(ids)) == len(ids)
        assert not any(pair <= set(ids) for pair in NOT_TOGETHER)


def test_every_secret_can_be_typed_and_has_the_size_that_is_said():
    for case in MANY:
        for hidden in case.effects:
            effect = parse_effect(hidden.hide, 4)
            assert {key: effect[key] for key in hidden.keys if key != "cable"} == {
                key: value for key, value in hidden.keys.items() if key != "cable"
            }
            spec = SIZES[hidden.id]
            assert spec.low * 0.999 <= hidden.size <= spec.high * 1.001
    drag = next(h for case in MANY for h in case.effects if h.id == "constant-force")
    assert np.linalg.norm([drag.keys[f"f{axis}"] for axis in "xyz"]) == pytest.approx(drag.size)


def test_a_heavier_robot_gets_larger_forces_but_no_larger_lengths():
    for number in range(1, 61):
        light, heavy = (case_of(3, number, mass, 4).effects for mass in (11.0, 22.0))
        for a, b in zip(light, heavy, strict=True):
            assert b.size == pytest.approx((2.0 if SIZES[a.id].with_mass else 1.0) * a.size)


def test_a_campaign_is_the_same_whatever_else_is_made():
    assert case_of(7, 17, 11.0, 4) == MANY[16]
    assert [case_of(8, n, 11.0, 4) for n in range(1, 301)] != MANY


def test_what_the_catalogue_lacks_takes_turns_or_is_the_same_each_time():
    assert {lacking("unlisted", number) for number in range(1, len(OUTSIDE) + 1)} == set(OUTSIDE)
    assert not {lacking("each", number) for number in range(1, 100)} & set(OUTSIDE)
    assert {lacking("cable-mass", number) for number in range(1, 4)} == {"cable-mass"}
    assert lacking("", 5) == ""


def test_robots_are_relatives_of_the_papers_and_can_exist(irma4_file, tmp_path):
    paper = read_robot(irma4_file)
    setups = [random_setup(paper, np.random.default_rng([5, k])) for k in range(40)]
    for k, setup in enumerate(setups):
        write_robot(tmp_path / f"{k}.toml", setup.robot)
        again = read_robot(tmp_path / f"{k}.toml")  # its checks: axes at right angles, limits in order
        assert exists(again.nominal.inertia_about_com)
        assert all(cable.radius > 0 for cable in again.cables)
    assert {len(setup.robot.markers) for setup in setups} == {1, 2, 3, 4}
    assert {setup.lengths for setup in setups} == {True, False}
    assert {setup.robot.winches is None for setup in setups} == {True, False}
    assert len({setup.rate for setup in setups}) == 4


def test_turning_about_the_vertical_is_a_rotation():
    turn = about_vertical(0.7)
    assert turn @ turn.T == pytest.approx(np.eye(3))
    assert turn @ [1.0, 0.0, 0.0] == pytest.approx([np.cos(0.7), np.sin(0.7), 0.0])
