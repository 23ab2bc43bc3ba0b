"""`fidim import gyro`: from a phone's angular rates and a tape's lengths to a campaign folder."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fidim_lab.app.terminal import console
from fidim_lab.arrays import PerCable
from fidim_lab.data.campaign import refuse_taken, write_campaign
from fidim_lab.data.files.json_file import write_json
from fidim_lab.data.importers.gyro_csv import RATE_UNITS, GyroRecording, read_gyro
from fidim_lab.data.own_sensors import RATES
from fidim_lab.data.records import Campaign, Robot, Role, Window
from fidim_lab.data.robot_file import read_robot
from fidim_lab.errors import FidimError, InfeasibleError, RefusedError, SetupError
from fidim_lab.identification.data_checks.gyro_axes import Axes, all_axes, better_axes, turn_of
from fidim_lab.identification.motion.free_swing import FreeSwing, free_swings, rate_noise
from fidim_lab.model.mechanism import Mechanism

GYRO = "gyro"
PLAIN: Axes = ("x", "y", "z")
HELD_OUT = 6
"""windows, from which on every third one is for validation: with fewer the fit needs all"""
WILD = 1.5
"""rad: a pendulum that turns farther is none; rates in degrees make it turn 57 times as far"""
SLACK = 0.01
"""rad: a swing that turns by less may be in another unit"""


@dataclass(frozen=True)
class GyroOptions:
    """What was said beside the files."""

    robot: Path
    lengths: tuple[str, ...] = ()
    """one for all files, or one for each"""
    axes: str | None = None
    unit: str | None = None


def import_gyro_command(files: Sequence[Path], out: Path, options: GyroOptions, json_file: Path | None) -> int:
    """Import, say what was found. Returns the exit code; raises FidimError."""
    refuse_taken(out)
    robot = read_robot(options.robot)
    if options.unit is not None and options.unit not in RATE_UNITS:
        raise SetupError(
            f"--unit {options.unit} is not a unit of angular rates.", hint="Give --unit rad/s or --unit deg/s."
        )
    axes, lengths = axes_of(options.axes), taped_lengths(options.lengths, len(files), robot.n)
    parts, skipped = list[tuple[GyroRecording, PerCable, tuple[FreeSwing, ...]]](), dict[str, str]()
    for path, held in zip(files, lengths, strict=True):
        try:
            recording = read_gyro(path, options.unit)
            parts.append((recording, held, _swings(recording)))
        except FidimError as error:
            if len(files) == 1:
                raise
            skipped[path.name] = str(error)
    if not parts:
        raise RefusedError(f"None of {len(files)} files can be used; the first: {next(iter(skipped.values()))[:300]}")
    _check_axes(robot, parts, axes)
    campaign = _campaign(out.name, robot, parts, axes)
    comment = (
        f"gyro_noise is that of these windows, by fourth differences of {len(campaign.windows)} free swings; "
        "encoder_resolution is the error of a length by tape."
    )
    write_campaign(out, campaign, robot_comment=comment)
    _tell(parts, campaign, skipped, out)
    if json_file is not None:
        said = [{"file": one.path.name, "decided": one.decided, "swings": len(swings)} for one, _, swings in parts]
        write_json(json_file, {"files": said, "skipped": skipped})
    return 0


def axes_of(text: str | None) -> Axes:
    """The axes of "y,-x,z"; the plain ones where none are given. Raises SetupError."""
    if text is None:
        return PLAIN
    asked = tuple(part.strip().lower().removeprefix("+") for part in text.split(","))
    if asked not in all_axes():
        raise SetupError(
            f"--axes {text[:40]} does not name three of the phone's axes in a right-handed order.",
            hint="Give those that point along x, y, z of the body, such as x,y,z or y,-x,z.",
        )
    return (asked[0], asked[1], asked[2])


def taped_lengths(texts: Sequence[str], files: int, n: int) -> list[PerCable]:
    """What --lengths says of each file, m. Raises SetupError."""
    if len(texts) not in (1, files):
        given = f"{len(texts)} times" if texts else "nowhere"
        what = f"--lengths is given {given}, for {files} files: once for all, or once for each in their order."
        raise SetupError(what, hint="Lengths by tape, m, from anchor to attachment: --lengths 2.38,2.38.")
    found: list[PerCable] = []
    for text in texts:
        try:
            values = np.array([float(part) for part in text.split(",")])
        except ValueError:
            values = np.zeros(0)
        if len(values) != n or not (np.isfinite(values) & (values > 0)).all():
            raise SetupError(f"--lengths {text[:60]} is not {n} lengths in m, one for each cable of the robot file.")
        found.append(values)
    return found * files if len(found) == 1 else found


def _swings(recording: GyroRecording) -> tuple[FreeSwing, ...]:
    """The free swings of a file. Raises RefusedError where there is none, or rates are in another unit."""
    found = free_swings(recording.t, recording.rates)
    name = recording.path.name
    if not found:
        missing = float(np.isnan(recording.rates).any(axis=1).mean())
        lost = f", and {100 * missing:.0f} % of its time is missing or saturated" if missing > 0.05 else ""
        raise RefusedError(
            f"{name} holds no free swing of 5 s or more in its {np.ptp(recording.t):.1f} s{lost}.",
            hint="Let the pendulum go and leave it alone for 20 s while recording, with the phone fixed on it.",
        )
    turned = max(_turned(recording, swing) for swing in found)
    if turned > WILD:
        raise RefusedError(
            f"{name}: by these rates the pendulum would turn by {turned:.3g} rad to each side; {WILD:g} are possible.",
            hint="They look like degrees per second: --unit deg/s.",
        )
    if turned < SLACK and not recording.unit_said:
        raise RefusedError(f"{name}: the pendulum turns by {turned:.2g} rad to each side only.", hint="State --unit.")
    return found


def _turned(recording: GyroRecording, swing: FreeSwing) -> float:
    """Largest angle about an axis, rad: rates summed up, without what grows with time."""
    rates = np.nan_to_num(recording.rates[swing.first : swing.last])
    t = recording.t[swing.first : swing.last]
    angles = np.cumsum(rates - rates.mean(axis=0), axis=0) / recording.rate
    powers = np.vander(t - t.mean(), 3)
    rest = angles - powers @ np.linalg.lstsq(powers, angles, rcond=None)[0]
    return float(np.sqrt(2) * rest.std(axis=0).max())


def _check_axes(
    robot: Robot, parts: Sequence[tuple[GyroRecording, PerCable, tuple[FreeSwing, ...]]], axes: Axes
) -> None:
    """Raises RefusedError where other axes explain the swings and these do not; SetupError for impossible lengths."""
    mechanism = Mechanism(robot)
    for recording, lengths, swings in parts:
        rows = [slice(swing.first, swing.last) for swing in swings]
        known = [(recording.t[row], np.nan_to_num(recording.rates[row])) for row in rows]
        try:
            better = better_axes(mechanism, lengths, known, axes)
        except InfeasibleError as error:
            raise SetupError(f"{recording.path.name}, --lengths: {error.message}", hint=error.hint) from error
        if better:
            ways = " or ".join(f"--axes={','.join(way)}" for way in better[:3])
            raise RefusedError(
                f"{recording.path.name}: with the phone's axes along {','.join(axes)} of the body, what turns is not "
                "what these cables let turn.",
                hint=f"Which axis of the phone points where? {ways} would fit.",
            )


def _campaign(
    name: str, robot: Robot, parts: Sequence[tuple[GyroRecording, PerCable, tuple[FreeSwing, ...]]], axes: Axes
) -> Campaign:
    windows: list[Window] = []
    noises: list[float] = []
    for recording, lengths, swings in parts:
        turned = recording.rates @ turn_of(axes).T
        for swing in swings:
            rows = slice(swing.first, swing.last)
            t, rates = recording.t[rows], turned[rows]
            noises.append(rate_noise(rates))
            windows.append(
                Window(
                    id=f"w{len(windows) + 1}",
                    role=Role.IDENTIFY,
                    t=t,
                    markers=np.full((len(t), 1, 3), np.nan),
                    lengths=np.tile(lengths, (len(t), 1)),
                    currents=None,
                    further=dict(zip(RATES, rates.T, strict=True)),
                )
            )
    if len(windows) >= HELD_OUT:
        windows = [replace(w, role=Role.VALIDATE if k % 3 == 2 else w.role) for k, w in enumerate(windows)]
    sensors = replace(robot.sensors, gyro_noise=float(f"{np.sqrt(np.mean(np.square(noises))):.3g}"))
    return Campaign(name, replace(robot, sensors=sensors), parts[0][0].rate, tuple(windows))


def _tell(
    parts: Sequence[tuple[GyroRecording, PerCable, tuple[FreeSwing, ...]]],
    campaign: Campaign,
    skipped: dict[str, str],
    out: Path,
) -> None:
    for recording, _, swings in parts:
        when = ", ".join(f"{recording.t[s.first]:.1f} to {recording.t[s.last - 1]:.1f} s" for s in swings)
        console.out.print(
            f"{recording.path.name}: free swings {when}; {'; '.join(recording.decided)}.", highlight=False
        )
    for name, why in skipped.items():
        console.out.print(f"{name} is skipped: {why}", highlight=False)
    console.out.print(
        f"{len(campaign.windows)} windows in {out}; a rate has {1e3 * campaign.robot.sensors.gyro_noise:.2g} mrad/s of "
        f"noise. fidim identify {out} tells what they show of the body, which the phone is a part of.",
        highlight=False,
    )
