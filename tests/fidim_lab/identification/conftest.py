"""Recordings made from the project's own model: what goes in must come out."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Body, Campaign, Motion, Robot, Role, Window
from fidim_lab.identification.motion.trajectory import to_surface
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import free_twist_basis, marker_selector, simulate_free_motion

TRUE_BODY = Body(com=np.array([0.004, -0.003, 0.196]), inertia=np.array([0.058, 0.064, 0.033, 4e-4, -5e-4, 3e-4]))
PLACES = ((1.25, -0.15, -0.2), (1.1, 0.1, -0.35), (1.35, -0.35, -0.3), (1.2, -0.3, -0.1), (1.4, 0.05, -0.25))
EXTRA = tuple(np.array(m) for m in ((0.15, 0.0, 0.1), (-0.08, 0.14, 0.12), (-0.06, -0.15, 0.05)))

MakeCampaign = Callable[..., Campaign]


def free_motion_at(robot: Robot, place: tuple[float, ...], kick: tuple[float, float], t: np.ndarray) -> tuple:
    """Lengths and motion of the true body, struck at its equilibrium: marker x, y start at `kick` m/s."""
    mechanism = Mechanism(robot)
    rest = equilibrium_at(mechanism, TRUE_BODY, np.array(place))
    pose = to_surface(mechanism, rest.lengths, rest.pose)
    xi = mechanism.structure_matrix(pose.position[None], pose.rotation[None])
    basis = free_twist_basis(xi, marker_selector(pose.rotation[None], robot.marker, (0, 1)))[0]
    found = simulate_free_motion(mechanism, TRUE_BODY, pose, basis @ np.array(kick), t)
    assert found.slack_time is None, f"the test's own motion at {place} lets cable {found.slack_cable} go slack"
    return rest.lengths, found.motion


@pytest.fixture(scope="session")
def exact_motions(irma4: Robot) -> list[tuple[np.ndarray, Motion]]:
    t = np.arange(601) / 100
    kicks = [(0.35, 0.2), (-0.25, 0.35), (0.3, -0.3), (0.2, 0.4), (-0.35, 0.25)]
    return [free_motion_at(irma4, place, kick, t) for place, kick in zip(PLACES, kicks, strict=True)]


@pytest.fixture(scope="session")
def recorded(irma4: Robot, exact_motions: list[tuple[np.ndarray, Motion]]) -> MakeCampaign:
    """A campaign of those motions with white marker noise; `cluster` adds three markers."""

    def make(*, noise: float = 0.0, cluster: bool = False, seed: int = 0, seconds: float = 6.0) -> Campaign:
        robot = replace(irma4, extra_markers=EXTRA) if cluster else irma4
        random = np.random.default_rng(seed)
        windows = []
        for k, (lengths, motion) in enumerate(exact_motions):
            use = motion.t <= seconds + 1e-9
            p, R = motion.positions[use], motion.rotations[use]
            markers = p[:, None] + np.einsum("nij,mj->nmi", R, robot.markers)
            markers = markers + noise * random.standard_normal(markers.shape)
            role = Role.VALIDATE if k == 4 else Role.IDENTIFY
            windows.append(Window(f"w{k + 1}", role, motion.t[use], markers, np.tile(lengths, (len(p), 1)), None))
        return Campaign("made up", robot, 100.0, tuple(windows))

    return make


@pytest.fixture(scope="session")
def true_body() -> Body:
    return TRUE_BODY
