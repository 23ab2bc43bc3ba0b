"""Robots whose cables meet nearly in one point: frames, touched ends, stretch by statics, and the fit of all of it."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.identification.elastic_motion import simulate_elastic_motion
from fidim_lab.data.records import Body, Campaign, Role, Window
from fidim_lab.effects.cables.cable_elasticity import CableStiffness
from fidim_lab.effects.dissipation.attachment_friction import AttachmentFriction, AttachmentFrictionGivingWay
from fidim_lab.effects.dissipation.drag import RotationalDragPerAxis
from fidim_lab.effects.geometry.frames import FrameMisalignment
from fidim_lab.identification.calibration.stretch import seen_stretch
from fidim_lab.identification.mle.fit import fit
from fidim_lab.identification.mle.frames import MarkerSet, free_frames
from fidim_lab.identification.mle.judge import Remainder
from fidim_lab.identification.mle.odd_windows.touched import TouchedEnd, together, untouched
from fidim_lab.identification.mle.soft import fit_soft, working_noise
from fidim_lab.identification.mle.starts.start import first_guess
from fidim_lab.identification.mle.trajectories.optimise import Ending
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.identification.mle.warm_start import Newcomer, exchanged
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism

SHAPE = tuple(np.array(m) for m in ([0.1, 0.0, 0.3], [-0.1, 0.1, 0.25], [0.0, -0.2, 0.2]))
SOFT, DRAG = 2.4e-5, (0.02, 0.03, 0.04)
PLACES = ((1.25, -0.15, -0.2), (1.1, 0.1, -0.35), (1.35, -0.35, -0.3), (1.2, 0.0, -0.3))


@pytest.fixture(scope="module")
def meeting(four):
    """Its attachments within a few centimetres, four markers."""
    cables = tuple(replace(cable, a=cable.a * np.array([0.1, 0.1, 1.0])) for cable in four.cables)
    return replace(four, cables=cables, extra_markers=SHAPE)


@pytest.fixture(scope="module")
def swinging(meeting, truth) -> list[Window]:
    """Elastic motions with drag."""
    return recorded(Mechanism(meeting, (CableStiffness(), RotationalDragPerAxis()), [SOFT, *DRAG]), truth(meeting))


def recorded(mechanism: Mechanism, body: Body) -> list[Window]:
    """Elastic motions, load cells that lag by 20 ms, lengths and markers with their noise."""
    robot = mechanism.robot
    random = np.random.default_rng(5)
    t = np.arange(151) / 100
    windows = []
    for k, place in enumerate(PLACES):
        rest = equilibrium_at(Mechanism(robot), body, np.array(place))
        lengths = rest.lengths - SOFT * robot.mass * rest.tensions
        twist = np.concatenate([0.15 * random.standard_normal(3), 0.6 * random.standard_normal(3)])
        xi = mechanism.structure_matrix(rest.pose.position[None], rest.pose.rotation[None])[0]
        twist -= np.linalg.pinv(xi) @ xi @ twist
        found = simulate_elastic_motion(mechanism, body, rest.pose, twist, t, lengths)
        assert found.slack_time is None
        arms = np.einsum("nij,mj->nmi", found.motion.rotations, robot.markers)
        places = found.motion.positions[:, None] + arms
        places = places + robot.sensors.marker_noise * random.standard_normal(places.shape)
        tensions = robot.mass * found.tensions
        late = np.column_stack([np.interp(t - 0.02, t, column) for column in tensions.T])
        cells = {f"f{i + 1}": late[:, i] for i in range(4)}
        role = Role.VALIDATE if k == 3 else Role.IDENTIFY
        windows.append(Window(f"w{k + 1}", role, t, places, np.tile(lengths, (len(t), 1)), None, further=cells))
    return windows


def test_statics_tells_stretch_and_the_cells_delay(meeting, swinging):
    seen = seen_stretch(meeting, swinging)
    assert seen is not None
    assert seen.clear
    assert seen.softness == pytest.approx(SOFT, rel=0.03)
    assert seen.delay == pytest.approx(0.02, abs=0.005)
    assert seen.explained > 0.2
    assert seen.sd < seen.doubt < seen.softness


def test_without_cells_or_markers_statics_says_nothing(meeting, swinging):
    assert seen_stretch(meeting, [replace(window, further={}) for window in swinging]) is None
    assert seen_stretch(meeting, [replace(window, markers=window.markers[:, :1]) for window in swinging]) is None
    assert seen_stretch(meeting, swinging[:2]) is None


def test_unstretchable_cables_show_no_clear_stretch(meeting, swinging):
    random = np.random.default_rng(0)
    shuffled = [replace(w, further={name: random.standard_normal(len(w.t)) for name in w.further}) for w in swinging]
    seen = seen_stretch(meeting, shuffled)
    assert seen is not None
    assert seen.explained < 0.1


def test_frames_are_free_only_where_markers_span_one(meeting, swinging):
    assert [frame.id for frame in free_frames(meeting, swinging)] == ["frame-misalignment", "marker-set"]
    assert free_frames(meeting, [replace(swinging[0], markers=swinging[0].markers[:, :1])]) == ()
    assert free_frames(meeting, []) == ()


def test_the_first_guess_looks_through_turned_cameras_and_markers(meeting, swinging):
    mechanism = Mechanism(meeting, (FrameMisalignment(), MarkerSet()))
    body = meeting.nominal
    plain = first_guess(Mechanism(meeting), body, prepare(swinging[0], meeting))
    turn = np.array([0.02, -0.03, 0.04])
    theta = np.concatenate([turn, [0.03, -0.02, 0.01], np.zeros(6)])
    half = turn / 2
    cross = np.array([[0, -half[2], half[1]], [half[2], 0, -half[0]], [-half[1], half[0], 0]])
    cayley = np.linalg.solve(np.eye(3) - cross, np.eye(3) + cross)
    seen = replace(swinging[0], markers=swinging[0].markers @ cayley.T + theta[3:6])
    guess = first_guess(mechanism, body, prepare(seen, meeting), theta)
    np.testing.assert_allclose(guess.position, plain.position, atol=1e-5)
    np.testing.assert_allclose(guess.rotation, plain.rotation, atol=1e-4)
    np.testing.assert_allclose(guess.twist, plain.twist, atol=1e-3)


def left_of(window: Window, sizes) -> Remainder:
    """A remainder whose sixths have these rms."""
    sixth = np.minimum((6 * (window.t - window.t[0]) / window.t[-1]).astype(int), 5)
    residuals = np.broadcast_to(np.array(sizes)[sixth, None, None], window.markers.shape)
    return Remainder(window.t, residuals, window.markers - residuals, 1.0, 1, 1e-3, None, None)


@pytest.mark.parametrize(
    ("sizes", "first", "last"),
    [
        ([9, 3, 3, 3, 3, 3], 0.25, 1.5),
        ([3, 3, 3, 3, 3, 9], 0.0, 1.25),
        ([5, 3, 3, 3, 3, 5], 0.0, 1.5),
        ([0.09, 0.03, 0.03, 0.03, 0.03, 0.03], 0.0, 1.5),
    ],
    ids=["start", "end", "neither", "below the noise"],
)
def test_only_ends_that_stand_out_are_cut(swinging, sizes, first, last):
    window = swinging[0]
    kept, cuts = untouched([window], {window.id: left_of(window, 1e-3 * np.array(sizes))}, noise=2e-4)
    assert kept[0].t[0] == pytest.approx(first, abs=0.011)
    assert kept[0].t[-1] == pytest.approx(last, abs=0.011)
    assert len(cuts) == (first > 0) + (last < 1.5)
    assert all(len(column) == len(kept[0].t) for column in kept[0].further.values())
    assert all("window w1" in cut.says for cut in cuts)


def test_what_was_cut_in_rounds_is_said_once():
    rounds = [TouchedEnd("w1", early=False, seconds=s) for s in (1.67, 1.39, 1.16)]
    first = TouchedEnd("w1", early=True, seconds=0.5, gently=True)
    assert [cut.says[:42] for cut in together([rounds[0], first, *rounds[1:]])] == [
        "The last 4.22 s of window w1 are missed by",
        "The first 0.50 s that were kept of window ",
    ]


def test_model_error_counts_once_for_all_markers_and_a_while(meeting, swinging):
    twice = [replace(window, markers=np.tile(window.markers, (1, 2, 1))) for window in swinging]
    assert working_noise(meeting, twice) == pytest.approx(np.sqrt(2) * working_noise(meeting, swinging))
    slower = [replace(w, t=w.t[::5], markers=w.markers[::5]) for w in swinging]
    assert working_noise(meeting, swinging) > 2 * working_noise(meeting, slower)


@pytest.mark.slow
def test_a_small_soft_robot_is_found(meeting, swinging, truth):
    campaign = Campaign("soft", meeting, 100.0, tuple(swinging))
    soft = fit_soft(campaign)
    assert soft.found.ending in (Ending.CONVERGED, Ending.EDGE)
    assert soft.stretch is not None
    assert soft.stretch.clear
    assert "by statics" in soft.sentences[0]
    assert not soft.cut
    left = np.array([remainder.rms for remainder in soft.found.remainders])
    assert left.max() < 2e-4
    body = truth(meeting)
    assert soft.found.body.com[2] == pytest.approx(body.com[2], rel=0.02)
    np.testing.assert_allclose(soft.found.body.inertia[:3], body.inertia[:3], rtol=0.05)
    held = soft.predict(swinging[3])
    assert held.remainder.rms < 3e-4


@pytest.mark.slow
def test_friction_that_gives_way_is_found_from_the_optimum_of_friction_that_slips_at_once(meeting, truth):
    dry, about_z, give = 0.01, 0.05, 0.04
    giving, slipping = AttachmentFrictionGivingWay(), AttachmentFriction()
    hidden = Mechanism(meeting, (CableStiffness(), giving), [SOFT, 0.0, dry, about_z, give])
    windows = recorded(hidden, truth(meeting))[:3]
    plain = fit(Mechanism(meeting, (CableStiffness(), slipping), [SOFT, 0.001, 0.005]), windows)
    newcomer = Newcomer(giving, [0.001, 0.01, 0.01, 0.03], [0.1, 0.1, 0.1, 0.03], [0, 0, 0, 0.003], [1, 1, 1, 1])
    found = exchanged(plain, slipping, newcomer)
    assert found is not None
    count = sum(remainder.dof for remainder in found.remainders)
    assert found.journey.optimum.cost == pytest.approx(count, rel=0.1)
    assert plain.journey.optimum.cost > 1.2 * count
    assert found.names[-4:] == ("viscous", "dry", "dry_z", "give")
    values, sd = found.values[found.place_of(giving)], found.sd[found.place_of(giving)]
    assert (np.abs(values - [0.0, dry, about_z, give]) < 4 * sd + 1e-3).all()
    assert values[2:] == pytest.approx([about_z, give], rel=0.3)
    with pytest.raises(KeyError):
        found.place_of(slipping)
