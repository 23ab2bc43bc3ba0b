"""`fidim import KIND SOURCE… --out DIR`: from another lab's recording to a campaign folder.

    read → cluster shape → registration → arrangement and clocks → hand-free windows → campaign.toml, import.json

Every estimate is made by the layer that owns it; here they are put in order. `run_import` returns the report,
`import_command` is what the command line calls.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fidim_lab.app.records.import_report import ImportReport, summary, table
from fidim_lab.app.terminal import console
from fidim_lab.arrays import Positions, Rotations
from fidim_lab.data.campaign import refuse_taken, write_campaign
from fidim_lab.data.files.json_file import write_json
from fidim_lab.data.importers.recording import Recording
from fidim_lab.data.importers.registry import read_recording
from fidim_lab.data.records import Campaign, Robot, Role, Sensors, Window
from fidim_lab.data.rigid_body import ClusterShape, cluster_shape, fit_pose
from fidim_lab.errors import RefusedError
from fidim_lab.identification.calibration.arrangement import ArrangementEvidence, at_times, choose, judge
from fidim_lab.identification.calibration.registration import Registration, register
from fidim_lab.identification.motion.hand_free import HandFree, find_hand_free
from fidim_lab.model.mechanism import Mechanism

JOURNAL = "import.json"
HELD_OUT = 0.4
"""share of the windows, the shortest ones, that validate; the long ones excite more modes and are fitted"""
REST_ENERGY = 1e-4
"""kinetic energy over its 95th percentile under which the platform is at rest"""
REST_TIME = 0.5
"""s of rest that give an equilibrium"""


def import_command(kind: str, sources: list[Path], out: Path, json_file: Path | None) -> int:
    """Import and print the summary. Returns the exit code; raises FidimError."""
    report = run_import(kind, sources, out)
    if json_file is not None:
        json_file.write_text((out / JOURNAL).read_text(encoding="utf-8"), encoding="utf-8")
    summary(report, console.out)
    return 0


def run_import(kind: str, sources: Sequence[Path], out: Path) -> ImportReport:
    """Read a recording, find everything that is unknown about it, write a campaign folder.

    Raises SetupError where `out` exists or the kind is unknown, FileError where a file is wrong, RefusedError where
    the recording cannot be registered or holds no hand-free window.
    """
    refuse_taken(out)
    recording = read_recording(kind, sources)
    cluster = cluster_shape(recording.markers.positions)
    positions, rotations, _ = fit_pose(recording.markers.positions, cluster.markers)
    mechanism = Mechanism(recording.robot)
    t = recording.markers.t
    arrangements = tuple(
        judge(mechanism, registration, t, positions, rotations, recording.log)
        for registration in register(mechanism, positions, rotations)
    )
    chosen = choose(arrangements)
    placed = chosen.stretched.poses(positions, rotations)
    hand_free = find_hand_free(mechanism, t, *placed)
    if not hand_free.windows:
        raise RefusedError(
            f"{recording.markers.source.name} holds no hand-free window of 1.5 s or more.",
            hint="Let go of the platform for several seconds while recording.",
        )
    campaign = Campaign(
        name=recording.name,
        robot=_robot(recording.robot, cluster, chosen.stretched),
        sample_rate=recording.markers.rate,
        windows=_windows(recording, chosen, hand_free, placed),
    )
    report = ImportReport(recording, cluster, arrangements, chosen, hand_free, campaign, out)
    write_campaign(out, campaign, robot_comment=_comment(report))
    write_json(out / JOURNAL, table(report))
    return report


def _robot(robot: Robot, cluster: ClusterShape, registration: Registration) -> Robot:
    """The robot with its markers, and sensors as good as this recording shows them to be."""
    markers = registration.body.points(cluster.markers)
    return replace(
        robot,
        marker=markers[0],
        extra_markers=tuple(markers[1:]),
        sensors=Sensors(marker_noise=cluster.noise, encoder_resolution=registration.rms),
    )


def _windows(
    recording: Recording, chosen: ArrangementEvidence, hand_free: HandFree, placed: tuple[Positions, Rotations]
) -> tuple[Window, ...]:
    markers, log = recording.markers, recording.log
    in_world = chosen.stretched.world.points(markers.positions)
    log_time = markers.t + chosen.clock.offset
    counted = at_times(log_time, log.t, log.lengths)
    lengths = counted - np.nanmean(counted, axis=0) + chosen.stretched.lengths
    further = _further(recording, log_time)
    rest = _rest(in_world, hand_free, 1.0 / markers.rate)
    roles = _roles([window.duration for window in hand_free.windows])
    windows: list[Window] = []
    for number, (found, role) in enumerate(zip(hand_free.windows, roles, strict=True), start=1):
        rows = (markers.t >= found.begin - 1e-9) & (markers.t <= found.end + 1e-9)
        windows.append(
            Window(
                id=f"w{number}",
                role=role,
                t=markers.t[rows],
                markers=in_world[rows],
                lengths=lengths[rows],
                currents=None,
                equilibrium=rest,
                further={name: values[rows] for name, values in further.items()},
            )
        )
    return tuple(windows)


def _further(recording: Recording, log_time: np.ndarray) -> dict[str, np.ndarray]:
    """Swivel angles s1… (rad), load cells f1… (N), inclinometer incl_x… (rad) at the markers' times."""
    log = recording.log
    named = (
        *((f"s{cable + 1}", column) for cable, column in enumerate(log.swivels.T)),
        *((f"f{cable + 1}", column) for cable, column in enumerate(log.tensions.T)),
        *((f"incl_{axis}", column) for axis, column in zip("xyz", log.inclinometer.T, strict=True)),
    )
    return {name: at_times(log_time, log.t, column[:, None])[:, 0] for name, column in named}


def _rest(in_world: np.ndarray, hand_free: HandFree, step: float) -> np.ndarray | None:
    """The main marker while the platform hung still; the motors are locked, so it is the same for all windows."""
    energy = hand_free.balance.energy
    still = (energy < REST_ENERGY * np.percentile(energy, 95)) & np.isfinite(in_world[:, 0]).all(axis=1)
    if still.sum() * step < REST_TIME:
        return None
    return np.median(in_world[still, 0], axis=0)


def _roles(durations: Sequence[float]) -> tuple[Role, ...]:
    """The shortest windows validate, at most `HELD_OUT` of them."""
    shortest = np.argsort(durations, kind="stable")[: int(HELD_OUT * len(durations))]
    return tuple(Role.VALIDATE if k in shortest else Role.IDENTIFY for k in range(len(durations)))


def _comment(report: ImportReport) -> str:
    registration = report.registration
    return (
        f"Written by fidim import {report.recording.kind}: geometry and nominal body from "
        f"{report.recording.geometry_source.name}, markers found from {report.recording.markers.source.name}.\n"
        f"marker_noise is what a rigid body leaves of the markers, {report.cluster.noise * 1e3:.2f} mm.\n"
        "encoder_resolution is how far the lengths by kinematics stray from constant, "
        f"{registration.rms * 1e3:.2f} mm rms: the encoders count from an unknown zero."
    )
