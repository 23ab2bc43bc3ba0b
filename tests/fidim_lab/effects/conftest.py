"""The paper's robot in a state with nothing special about it, and numbers out of the effects' expressions.

A test that asks for `effect` runs for every class of the catalogue and `BESIDE`: once for all cables (or the platform),
and once for the last cable.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fidim_lab.data.records import Robot
from fidim_lab.data.robot_file import read_robot
from fidim_lab.effects.catalogue import catalogue
from fidim_lab.effects.dissipation.attachment_friction import AttachmentFrictionGivingWay
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.effects.plausibility import Context
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion.equations import MotionEquations, Symbols, motion_equations

ROBOT = Path(__file__).parents[3] / "fidim_lab" / "data" / "robots" / "irma4.toml"

BESIDE = (AttachmentFrictionGivingWay(),)
"""effects that only fits with elastic cables know"""


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "effect" in metafunc.fixturenames:
        metafunc.parametrize("effect", list(_of_each_kind()), ids=lambda effect: effect.label)


def _of_each_kind() -> Iterator[NamedEffect]:
    chosen: dict[tuple[type, bool], NamedEffect] = {}
    for effect in (*catalogue(read_robot(ROBOT)), *BESIDE):
        chosen[type(effect), effect.cable is None] = effect
    yield from (effect for effect in chosen.values() if effect.parameters)


@dataclass(frozen=True, eq=False)
class Sample:
    """One state of a robot, as the model's compiled functions take it."""

    robot: Robot
    time: float
    position: np.ndarray
    rotation: np.ndarray
    twist: np.ndarray

    def inputs(self, mechanism: Mechanism, theta: np.ndarray) -> list[np.ndarray]:
        """time, position, rotation row by row, twist, extra, body, θ."""
        extra = 0.01 * np.arange(1, 1 + sum(len(effect.extra_states) for effect in mechanism.effects))
        if len(extra) == 6:  # a loose mass, near where it is held
            extra[:3] += self.position + self.rotation @ [0.0, 0.0, 0.1]
        flat = self.rotation.ravel()
        return [np.array(self.time), self.position, flat, self.twist, extra, self.robot.nominal.vector, theta]


@dataclass(frozen=True, eq=False)
class Probe:
    """Numbers from expressions of one mechanism at the sample."""

    sample: Sample
    mechanism: Mechanism

    def __call__(self, build: Callable[[MotionEquations], list[ca.SX]], theta: np.ndarray) -> list[np.ndarray]:
        """Values, as flat arrays, of expressions made of the equations of motion."""

        def compile_it(mechanism: Mechanism) -> ca.Function:
            equations = motion_equations(mechanism, Symbols.of(mechanism))
            return ca.Function("probe", equations.symbols.inputs, build(equations))

        compiled = self.mechanism.compiled(f"probe {build.__qualname__}", compile_it)
        return self.run(compiled, self.sample.inputs(self.mechanism, theta))

    @staticmethod
    def run(compiled: ca.Function, inputs: list[np.ndarray]) -> list[np.ndarray]:
        found = compiled(*inputs)
        return [np.array(part).ravel() for part in (found if isinstance(found, tuple) else (found,))]


@pytest.fixture(scope="session")
def sample(irma4: Robot) -> Sample:
    return Sample(
        robot=irma4,
        time=0.7,
        position=np.array([1.2, -0.2, -0.3]),
        rotation=Rotation.from_rotvec([0.1, -0.12, 0.2]).as_matrix(),
        twist=np.array([0.2, -0.3, 0.1, 0.4, -0.2, 0.3]),
    )


@pytest.fixture(scope="session")
def probe(sample: Sample) -> Callable[..., Probe]:
    return cache(lambda *effects, at=sample: Probe(at, Mechanism(at.robot, effects)))


@pytest.fixture(scope="session")
def middle() -> Callable[[NamedEffect], np.ndarray]:
    """An absent θ in the middle of the scan's grid."""

    def find(effect: NamedEffect) -> np.ndarray:
        points = effect.scan_points
        return points[len(points) // 2]

    return find


@pytest.fixture(scope="session")
def sized(middle: Callable[[NamedEffect], np.ndarray]) -> Callable[[NamedEffect], np.ndarray]:
    """A θ at which the effect is there, within its bounds."""

    def find(effect: NamedEffect) -> np.ndarray:
        theta = middle(effect)
        for k, (parameter, scanned) in enumerate(zip(effect.parameters, effect.scanned, strict=True)):
            if not scanned:
                theta[k] = parameter.scale * (1 + 0.3 * k)
        return theta

    return find


@pytest.fixture(scope="session")
def context(irma4: Robot) -> Context:
    return Context.of(irma4)
