"""From one recorded window to the platform's motion: poses, twists and accelerations at every sample that can be used.

`measure` is the door; `choose_variant` says which of the three ways (`recipe.Variant`) a window allows. What was
repaired, cut out or doubted comes along as notes: sentences for people.
"""

from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.arrays import Mask, Series
from fidim_lab.data.records import Campaign, Motion, Pose, Robot, Window
from fidim_lab.errors import InfeasibleError, RefusedError, SetupError
from fidim_lab.identification.motion import rigid, surface
from fidim_lab.identification.motion.recipe import Recipe, Variant
from fidim_lab.identification.motion.signals import Smooth, Track, smooth, uniform
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.kinematics import dependent_pose
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import AXIS_NAMES, best_axes, conditioning, marker_selector, motion_from_free

NOISY_CONDITION = 10.0
"""conditioning from which a window's equations are worth a note"""
MORE_MARKERS = "Use three markers that are not in line, other equilibria, or maximum likelihood (mle)."
"""against poses that markers and lengths do not show at some instants: mle reads them from the course of the motion"""
MISFIT_IN_NOISE = 5.0
"""a kinematic misfit of more than so many times the stated marker noise is worth a warning"""


@dataclass(frozen=True, eq=False)
class MeasuredMotion:
    """The motion of one window as its markers give it. All rows are usable samples, in order of time."""

    window: Window
    variant: Variant
    motion: Motion
    samples: np.ndarray
    """(N,) index of each row on the even time grid: neighbours differ by 1, a cut shows as a jump"""
    rate: float
    """Hz of that grid"""
    axes: tuple[int, ...]
    """free coordinates in which Ξ⊥ is expressed"""
    jacobian: np.ndarray
    """(N, K, 6): the measured accelerations (of K coordinates) as a function of v̇"""
    tied: bool
    """v and v̇ were made to obey the held lengths; otherwise they come from the markers alone"""
    conditioning: Series
    """(N,) of the free coordinates used"""
    misfit: float
    """rms of marker − pose, m; NaN where there is no redundancy to judge by"""
    notes: tuple[str, ...]
    broken_by: tuple[str, ...] = ()
    """what took samples from among the others, for people; empty where the rows follow each other without a break"""


def choose_variant(robot: Robot, window: Window, wanted: Variant | None) -> Variant:
    """The variant to use. Raises SetupError when the wanted one lacks markers or lengths in this window."""
    seen = np.isfinite(window.markers).all(axis=2).mean(axis=0) > 0.5
    rigid_set = rigid.spread(robot.markers[: window.markers.shape[1]][seen]) > rigid.MIN_SPREAD
    if wanted is Variant.FULL and not rigid_set:
        raise SetupError(
            f"Window {window.id}: the full pose needs three markers that are not in line; {int(seen.sum())} are usable."
        )
    variant = wanted or (Variant.FULL if rigid_set else Variant.SURFACE)
    if variant is not Variant.FULL and window.lengths is None:
        raise SetupError(
            f"Window {window.id} has no cable lengths (l1…ln), and too few markers to replace them.",
            hint="Record the encoders, or at least three markers that are not in line.",
        )
    if variant is Variant.SURFACE and 3 * int(seen.sum()) < robot.freedoms:
        raise SetupError(
            f"{int(seen.sum())} of {len(seen)} markers {'is' if seen.sum() == 1 else 'are'} seen in more than half of "
            f"it, and {robot.freedoms} motions are free with {robot.n} cable{'s' * (robot.n > 1)}: the pose of one "
            "sample is not known, so equations of motion (tls, ls, iv) cannot be formed.",
            hint="Use --method mle, which reads the rest from the course of the motion, or three markers not in line.",
        )
    return variant


def measure(mechanism: Mechanism, campaign: Campaign, window: Window, recipe: Recipe) -> MeasuredMotion:
    """The motion of one window.

    Raises SetupError where the window lacks what the recipe needs, InfeasibleError where lengths, geometry and markers
    contradict each other, RefusedError where no sample is left to use.
    """
    variant = choose_variant(campaign.robot, window, recipe.variant)
    match variant:
        case Variant.FREE:
            found = _free(mechanism, campaign, window, recipe)
        case Variant.SURFACE:
            found = _on_surface(mechanism, campaign, window, recipe)
        case Variant.FULL:
            found = _full(mechanism, campaign, window, recipe)
    return _drop_badly_conditioned(replace(found, broken_by=_gaps(found)), recipe)


def held_lengths(window: Window) -> np.ndarray:
    """l_0: the mean of the encoders' lengths over the window, (n,), m. Raises SetupError where there are none."""
    if window.lengths is None or not np.isfinite(window.lengths).any(axis=0).all():
        raise SetupError(f"Window {window.id} lacks cable lengths (l1…ln) for at least one cable.")
    return np.nanmean(window.lengths, axis=0)


def rest_pose(mechanism: Mechanism, window: Window) -> Pose:
    """A pose near the window's motion: the equilibrium of the nominal body, else the unrotated one at the markers.

    Raises SetupError where the lengths of a cable or all markers are missing.
    """
    lengths = held_lengths(window)
    robot = mechanism.robot
    middle = window.middle(robot.markers)
    if middle is None:
        raise SetupError(f"Window {window.id}: no marker is seen in any sample.")
    upright = Pose(position=middle - robot.marker, rotation=np.eye(3))
    try:
        return pose_from_lengths(mechanism, robot.nominal, lengths, upright).pose
    except InfeasibleError:
        return upright


def _tracks(window: Window, campaign: Campaign, markers: int) -> Track:
    flat = window.markers[:, :markers].reshape(len(window.t), -1)
    return uniform(window.t, flat, campaign.sample_rate)


def _smoothed(window: Window, track: Track, recipe: Recipe) -> tuple[Smooth, np.ndarray]:
    found = smooth(track, recipe.signals)
    samples = np.flatnonzero(found.usable)
    if len(samples) == 0:
        raise RefusedError(f"Window {window.id}: no sample has a whole neighbourhood to be filtered; too many gaps.")
    return found.at(samples), samples


def _free(mechanism: Mechanism, campaign: Campaign, window: Window, recipe: Recipe) -> MeasuredMotion:
    """Eq. 44–45."""
    robot = campaign.robot
    track = _tracks(window, campaign, 1)
    signals, samples = _smoothed(window, track, recipe)
    start = rest_pose(mechanism, window)
    axes = recipe.axes or _best_axes_at(mechanism, start, robot)
    if len(axes) != robot.freedoms:
        raise SetupError(
            f"This form of the equations takes {len(axes)} free coordinates ({', '.join(AXIS_NAMES[k] for k in axes)} "
            f"of the marker); {robot.n} cable{'s' * (robot.n > 1)} leave{'s' * (robot.n == 1)} {robot.freedoms}.",
            hint="Leave out --paper: the usual form takes any number of cables.",
        )
    if max(axes) > 2:
        raise SetupError(
            f"Window {window.id}: one marker gives three coordinates, {robot.freedoms} are free.",
            hint="Use more markers; the variant is then chosen by itself.",
        )
    chosen = list(axes)
    lengths = held_lengths(window)
    pose = dependent_pose(mechanism, lengths, robot.marker, axes, signals.value[:, chosen], start)
    motion = motion_from_free(
        mechanism, signals.t, pose, robot.marker, axes, signals.first[:, chosen], signals.second[:, chosen]
    )
    selector = marker_selector(pose[1], robot.marker, axes)
    others = [axis for axis in range(3) if axis not in axes]
    rest = signals.value - pose[0] - pose[1] @ robot.marker
    misfit = float(np.sqrt(np.mean(rest[:, others] ** 2))) if others else float("nan")
    cond = conditioning(mechanism.structure_matrix(*pose), selector)
    return MeasuredMotion(
        window, Variant.FREE, motion, samples, track.rate, axes, selector, True, cond, misfit,
        (*track.notes, *_misfit_note(robot, misfit)),
    )  # fmt: skip


def _on_surface(mechanism: Mechanism, campaign: Campaign, window: Window, recipe: Recipe) -> MeasuredMotion:
    """Least squares of all marker coordinates on the surface of the held lengths (`surface`)."""
    robot = campaign.robot
    track = _tracks(window, campaign, window.markers.shape[1])
    signals, samples = _smoothed(window, track, recipe)
    body_markers = robot.markers[: window.markers.shape[1]]
    measured = signals.value.reshape(len(samples), -1, 3)
    start = rest_pose(mechanism, window)
    found = surface.poses(mechanism, held_lengths(window), body_markers, measured, start)
    J = surface.marker_jacobian(found.rotations, body_markers)
    twists = surface.rates(mechanism, found, J, signals.first)
    wanted = signals.second - surface.centripetal(found.rotations, twists, body_markers)
    rates = surface.accelerations(mechanism, found, J, twists, wanted)
    motion = Motion(signals.t, found.positions, found.rotations, twists, rates)
    xi = mechanism.structure_matrix(found.positions, found.rotations)
    axes = recipe.axes or best_axes(xi, found.rotations, robot.marker)
    misfit = float(np.sqrt(np.mean(found.misfit[found.settled] ** 2)))
    cond = np.where(found.settled, surface.conditioning(xi, J), np.inf)
    return MeasuredMotion(
        window, Variant.SURFACE, motion, samples, track.rate, axes, J, True, cond, misfit,
        (*track.notes, *_misfit_note(robot, misfit)),
    )  # fmt: skip


def _full(mechanism: Mechanism, campaign: Campaign, window: Window, recipe: Recipe) -> MeasuredMotion:
    """Rigid registration of every sample, then differentiation of position and rotation (`rigid`)."""
    robot = campaign.robot
    body_markers = robot.markers[: window.markers.shape[1]]
    track = _tracks(window, campaign, len(body_markers))
    markers = track.values.reshape(len(track.t), -1, 3)
    half = recipe.signals.half_seconds(float(track.t[-1] - track.t[0]))
    weights = rigid.visibility(markers, max(1, round(half * track.rate)))
    positions, rotations, misfits = rigid.register(markers, body_markers, weights)
    reference = rigid.mean_rotation(rotations)
    pose = np.concatenate([positions, rigid.rotation_vectors(rotations, reference)], axis=1)
    signals, samples = _smoothed(window, Track(track.t, pose), recipe)
    R, omega, alpha = rigid.from_rotation_vectors(
        signals.value[:, 3:], signals.first[:, 3:], signals.second[:, 3:], reference
    )
    motion = Motion(
        signals.t,
        signals.value[:, :3],
        R,
        np.concatenate([signals.first[:, :3], omega], axis=1),
        np.concatenate([signals.second[:, :3], alpha], axis=1),
    )
    xi = mechanism.structure_matrix(motion.positions, R)
    axes = recipe.axes or best_axes(xi, R, robot.marker)
    J = surface.marker_jacobian(R, body_markers)
    misfit = float(np.sqrt(np.nanmean(misfits**2)))
    return MeasuredMotion(
        window, Variant.FULL, motion, samples, track.rate, axes, J, False, np.ones(len(samples)), misfit,
        (*_full_notes(track, markers), *_misfit_note(robot, misfit)),
    )  # fmt: skip


def _full_notes(track: Track, markers: np.ndarray) -> tuple[str, ...]:
    """With several markers a gap of one of them cuts nothing out; say what happened instead."""
    notes = [note for note in track.notes if "cut out" not in note]
    hidden = np.isnan(markers).any(axis=2).mean(axis=0)
    notes += [
        f"marker {m + 1} is hidden {100 * share:.0f} % of the time" for m, share in enumerate(hidden) if share > 0
    ]
    return tuple(notes)


def _best_axes_at(mechanism: Mechanism, pose: Pose, robot: Robot) -> tuple[int, ...]:
    xi = mechanism.structure_matrix(pose.position[None], pose.rotation[None])
    return best_axes(xi, pose.rotation[None], robot.marker)


def _misfit_note(robot: Robot, misfit: float) -> tuple[str, ...]:
    if not misfit > MISFIT_IN_NOISE * robot.sensors.marker_noise:
        return ()
    return (
        f"the markers miss the pose by {misfit * 1e3:.2f} mm rms ({misfit / robot.sensors.marker_noise:.0f} times "
        "their noise): geometry, lengths or cable stretch are not as the robot file says",
    )


def _gaps(found: MeasuredMotion) -> tuple[str, ...]:
    """What is missing between the first and the last usable sample, where something is."""
    missing = np.diff(found.samples) - 1
    if not missing.any():
        return ()
    count = int((missing > 0).sum())
    gaps = "a gap of the recording" if count == 1 else f"{count} gaps of the recording"
    return (f"{missing.sum() / found.rate:.2f} s are lost to {gaps} and to the filter beside it",)


def _drop_badly_conditioned(found: MeasuredMotion, recipe: Recipe) -> MeasuredMotion:
    good: Mask = found.conditioning <= recipe.max_condition
    worst = float(found.conditioning.max())
    if good.all() and worst < NOISY_CONDITION:
        return found
    if good.all():
        note = f"one free motion hardly moves what is measured (conditioning up to {worst:.0f}): noisier equations"
        return replace(found, notes=(*found.notes, note))
    share = 100 * (1 - good.mean())
    how = f"{', '.join(AXIS_NAMES[axis] for axis in found.axes)} " if found.variant is Variant.FREE else ""
    size = f"up to {worst:.0f}" if np.isfinite(worst) else "without bound"
    note = (
        f"in {share:.0f} % of the samples a free motion hardly moves the markers ({how}badly conditioned, {size}; at "
        f"most {recipe.max_condition:g} is used): the pose at such an instant is not known, and it is left out of the "
        "equations of motion"
    )
    if not good.any():
        raise RefusedError(f"Window {found.window.id}: {note}.", hint=MORE_MARKERS)
    m = found.motion
    kept = Motion(m.t[good], m.positions[good], m.rotations[good], m.twists[good], m.accelerations[good])
    return replace(
        found,
        motion=kept,
        samples=found.samples[good],
        jacobian=found.jacobian[good],
        conditioning=found.conditioning[good],
        notes=(*found.notes, note),
        broken_by=(*found.broken_by, note),
    )
