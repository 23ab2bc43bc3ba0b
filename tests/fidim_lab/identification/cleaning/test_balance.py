"""What noise of the markers leaves over in the equations of motion, foretold at each node."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Campaign, Role, Window
from fidim_lab.identification.cleaning.balance import balance
from fidim_lab.identification.cleaning.free_motion import hands
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.regressor import parameter_vector


@pytest.mark.parametrize("cluster", [False, True], ids=["one marker", "four markers"])
def test_noise_leaves_over_as_much_as_foretold(recorded, cluster):
    exact = recorded(cluster=cluster, seconds=3.0)
    robot, chi = exact.robot, parameter_vector(exact.robot.nominal)
    mechanism, sigma = Mechanism(robot), robot.sensors.marker_noise
    clean = balance(mechanism, exact.windows[0])
    seen = []
    for seed in range(30):
        found = balance(mechanism, recorded(cluster=cluster, seconds=3.0, noise=sigma, seed=seed).windows[0])
        seen.append((np.square((found.left - clean.left) @ chi)).sum(axis=1))
    ratio = np.mean(seen) / np.mean(clean.noise)
    assert 0.5 < ratio < 2.0  # by the nominal body, and without what noise does to places


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "places",
    [((0.0544, 0.0587, 0.1595), (0.143, -0.1139, 0.2174)), ((0.1423, 0.0606, 0.1332), (0.0109, 0.0598, 0.0498))],
)
def test_where_two_markers_hardly_show_the_motion_there_is_no_hand(irma4, exact_motions, places, seed):
    markers, noise = np.array(places), 2.5e-4
    sensors = replace(irma4.sensors, marker_noise=noise)
    robot = replace(irma4, marker=markers[0], extra_markers=markers[1:], sensors=sensors)
    random = np.random.default_rng(seed)
    windows = []
    for k, (lengths, motion) in enumerate(exact_motions):
        seen = motion.positions[:, None] + np.einsum("nij,mj->nmi", motion.rotations, markers)
        seen += noise * random.standard_normal(seen.shape)
        held = np.tile(lengths, (len(seen), 1))
        windows.append(Window(f"w{k + 1}", Role.IDENTIFY, motion.t, seen, held, None))
    assert hands(Campaign("two markers", robot, 100.0, tuple(windows))) == {}


@pytest.mark.parametrize(("speed", "is_held"), [(0.0, True), (1.0, False)], ids=["at rest", "swinging through"])
def test_what_is_left_over_where_the_inertial_forces_are_small_is_a_hand_only_at_rest(recorded, speed, is_held):
    exact = recorded(seconds=3.0)
    known = balance(Mechanism(exact.robot), exact.windows[0])
    middle = np.abs(known.t - known.t.mean()) < 0.3
    chi = parameter_vector(exact.robot.nominal)
    size = np.linalg.norm(known.inertial @ chi, axis=1)
    left = np.zeros_like(known.left)
    left[:, 0, 0] = np.where(middle, 0.6, 0.25) * np.median(size)  # m/s² per unit mass, whatever the body
    inertial = np.where(middle[:, None, None], 0.0, known.inertial)
    disturbed = replace(known, left=left, inertial=inertial, speeds=np.where(middle, speed, 1.0))
    cuts = hands(replace(exact, windows=exact.windows[:1]), [disturbed])
    assert bool(cuts) == is_held
