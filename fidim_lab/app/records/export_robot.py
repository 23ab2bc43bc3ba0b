"""The whole robot for other programs: cables, body and what an explanation named, from where a recorded window began.

`mjcf`: a model that MuJoCo runs. `python`: a module of functions (cable lengths → pose and tensions, zero dynamics).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np

from fidim_lab.app.compose.multibody import Multibody, multibody_mjcf
from fidim_lab.app.records.mjcf_effects import TERMS, MjcfModel
from fidim_lab.app.report.contents.found_model import Model, found_model, read_found
from fidim_lab.arrays import Vector3
from fidim_lab.data.records import Body, Campaign, Pose, Role, Window
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.errors import SetupError
from fidim_lab.identification.mle import held_out
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.model.geometry import rotation_matrix
from fidim_lab.model.slots import Effect

MOVING = ("length_drift", "compliance", "stretch_damping", "wrench", "tension_wrench", "kinetic_energy", "extra_rates")
"""slots by which an effect moves the platform otherwise; geometry and gravity are told, what only sensors see is not"""
HINT = "For the body without it, give the result of identify. docs/python.md lists what can be exported."
TILT = "gravity-tilt"
TEMPLATE = "feedforward.py.txt"


@dataclass(frozen=True, eq=False)
class WindowStart:
    """Where a window begins by the model, and what its file is called."""

    window: str
    pose: Pose
    twist: np.ndarray
    """(6,) [ṗ; ω], m/s and rad/s"""
    t: np.ndarray
    """(N,) s since the begin, of the predicted path"""
    marker: np.ndarray
    """(N, 3) m: where the main marker is on it, before what cameras make of it"""


def robot_model(source: Path, campaign: Campaign) -> Model:
    """The model that a result or an explanation file found. Raises FileError, SetupError for an unknown effect."""
    return found_model(read_found(source), campaign.robot, native=True)


def start_of(model: Model, campaign: Campaign, window: str | None) -> WindowStart:
    """Where a window (the first that is held out, else the first) begins. Raises SetupError for no such window.

    Raises RefusedError where its motion cannot be simulated.
    """
    chosen = _chosen(campaign, window)
    robot = model.mechanism.robot
    found = held_out.predict(model.mechanism, model.shared, prepare(chosen, robot), robot.sensors)
    path = found.journey.optimum.simulation.batches[0].trajectories
    marker = path.positions[0] + path.rotations[0] @ robot.markers[0]
    known = np.isfinite(marker).all(axis=1)
    begin = Pose(path.positions[0, 0], path.rotations[0, 0])
    return WindowStart(chosen.id, begin, path.twists[0, 0], path.grid.t[known], marker[known])


def robot_mjcf(model: Model, start: WindowStart, mass: float, origin: str) -> str:
    """The robot as MJCF. Raises SetupError where an effect was named that MJCF has no term for."""
    robot = model.mechanism.robot
    body = Body.from_vector(model.shared[:9])
    made = Multibody(
        cables=model.mechanism.geometry(),
        mass=mass,
        body=body,
        markers=robot.markers,
        gravity=gravity_of(model, "MJCF", tuple(TERMS)),
        pose=start.pose,
        twist=start.twist,
    )
    # effects are in newtons at the robot file's mass; another mass moves alike under as many times the force
    mjcf = MjcfModel(multibody_mjcf(made), body.com, mass / robot.mass)
    for effect, theta in _with_theta(model):
        if isinstance(effect, NamedEffect) and type(effect) in TERMS:
            TERMS[type(effect)](mjcf, effect, theta)
    comment = f"{origin} Keyframe start: window {start.window}.".replace("--", "- -")
    return f"<!-- {comment} -->\n{mjcf.text()}"


def robot_python(model: Model, start: WindowStart, mass: float, origin: str) -> str:
    """A module of functions, for numpy alone. Raises SetupError where an effect was named that it has no term for."""
    cables = model.mechanism.geometry()
    body = Body.from_vector(model.shared[:9])
    values = {name: np.array([getattr(cable, name) for cable in cables]) for name in ("d", "a", "x", "y", "z")}
    constants = {
        "MASS": repr(mass),
        "S": _array(body.com),
        "INERTIA": _array(body.inertia_matrix),
        "GRAVITY": _array(gravity_of(model, "The module")),
        "RADIUS": _array(np.array([cable.radius for cable in cables])),
        **{name.upper(): _array(value) for name, value in values.items()},
        "NEAR_POSITION": _array(start.pose.position),
        "NEAR_ROTATION": _array(start.pose.rotation),
    }
    written = "\n".join(f"{name} = {value}" for name, value in constants.items())
    text = (files("fidim_lab.app.records") / TEMPLATE).read_text(encoding="utf-8")
    return text.replace("@ORIGIN@", origin.replace('"', "'")).replace("@CONSTANTS@", written)


def gravity_of(model: Model, what: str, terms: tuple[type[Effect], ...] = ()) -> Vector3:
    """Gravity with what tilts it.

    Raises SetupError for an effect that neither geometry nor gravity can tell, nor is one of `terms`.
    """
    gravity = model.mechanism.robot.gravity
    for effect, theta in _with_theta(model):
        if isinstance(effect, NamedEffect) and effect.id == TILT:
            gravity = rotation_matrix(np.append(theta / 2, 0.0)) @ gravity
        elif type(effect) not in terms and _moves(effect):
            name = effect.label if isinstance(effect, NamedEffect) else type(effect).__name__
            raise SetupError(
                f"{what} has no term for {name}, which was named here.",
                hint=HINT,
            )
    return gravity


def _moves(effect: Effect) -> bool:
    return any(getattr(type(effect), slot) is not getattr(Effect, slot) for slot in MOVING)


def _with_theta(model: Model) -> Iterator[tuple[Effect, np.ndarray]]:
    first = 0
    for effect in model.mechanism.effects:
        last = first + len(effect.parameters)
        yield effect, model.mechanism.theta[first:last]
        first = last


def _chosen(campaign: Campaign, window: str | None) -> Window:
    candidates = campaign.of_role(Role.VALIDATE) or campaign.windows
    if window is None and candidates:
        return candidates[0]
    for one in campaign.windows:
        if one.id == window:
            return one
    known = ", ".join(one.id for one in campaign.windows) or "none"
    raise SetupError(f"--window {window}: no such window; there are {known}.")


def _array(values: np.ndarray) -> str:
    return f"np.array({np.asarray(values, dtype=float).tolist()!r})"
