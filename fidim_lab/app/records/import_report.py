"""What an import found, `ImportReport`: `table` for programs (import.json, "fidim-import/1"), `summary` for people."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from fidim_lab.app.terminal import console
from fidim_lab.data.alignment import ClockOffset
from fidim_lab.data.files.json_file import as_json
from fidim_lab.data.importers.recording import Recording
from fidim_lab.data.records import Campaign
from fidim_lab.data.rigid_body import ClusterShape
from fidim_lab.identification.calibration.arrangement import ArrangementEvidence
from fidim_lab.identification.calibration.registration import Registration
from fidim_lab.identification.motion.hand_free import HandFree
from fidim_lab.units import degrees, millimetres

FORMAT = "fidim-import/1"


@dataclass(frozen=True, eq=False)
class ImportReport:
    """What an import found and wrote."""

    recording: Recording
    cluster: ClusterShape
    arrangements: tuple[ArrangementEvidence, ...]
    chosen: ArrangementEvidence
    hand_free: HandFree
    campaign: Campaign
    folder: Path

    @property
    def registration(self) -> Registration:
        """The registration in force: the chosen arrangement, with stretch."""
        return self.chosen.stretched


def table(report: ImportReport) -> dict[str, object]:
    """Everything that was found, as plain values in SI units."""
    recording, cluster, hand_free = report.recording, report.cluster, report.hand_free
    registration, balance = report.registration, report.hand_free.balance
    found = {
        "format": FORMAT,
        "kind": recording.kind,
        "name": recording.name,
        "sources": {
            "markers": str(recording.markers.source),
            "log": str(recording.log.source),
            "geometry": str(recording.geometry_source),
        },
        "cluster": {
            "markers": list(recording.markers.names),
            "rms": cluster.rms,
            "rms_per_marker": cluster.rms_per_marker,
            "noise": cluster.noise,
            "frames_used": cluster.samples_used,
            "frames": len(recording.markers.t),
        },
        "registration": {
            "rms": registration.rms,
            "rms_per_cable": registration.rms_per_cable,
            "compliance": registration.compliance,
            "tilt": registration.tilt,
            "world": registration.world,
            "body": registration.body,
            "lengths": registration.lengths,
        },
        "arrangements": [_arrangement(evidence, evidence is report.chosen) for evidence in report.arrangements],
        "clock": {
            "log_minus_markers": report.chosen.clock,
            "by_inclinometer": report.chosen.inclinometer,
            "by_load_cells": report.chosen.load_cells,
        },
        "soft_directions": {
            "free_directions": balance.free_directions,
            "singular_values": balance.singular_values,
        },
        "windows": [
            {
                "id": window.id,
                "role": window.role.value,
                "t": [found.begin, found.end],
                "begins_after": found.before.value,
                "ends_before": found.after.value,
                "says": found.says,
            }
            for window, found in zip(report.campaign.windows, hand_free.windows, strict=True)
        ],
        "too_short": [[found.begin, found.end] for found in hand_free.too_short],
    }
    return as_json(found)


def summary(report: ImportReport, out: Console) -> None:
    """Print what was found and where it is, for people."""
    recording, cluster, chosen = report.recording, report.cluster, report.chosen
    registration = report.registration
    out.print(
        f"{recording.name}: {len(recording.markers.t)} frames of {len(recording.markers.names)} markers at "
        f"{recording.markers.rate:g} Hz, log of {recording.log.t[-1] - recording.log.t[0]:.1f} s, "
        f"geometry from {recording.geometry_source.name}"
    )
    out.print(
        f"Markers     rigid to {millimetres(cluster.rms):.2f} mm rms (noise {millimetres(cluster.noise):.2f} mm; worst "
        f"{recording.markers.names[int(np.argmax(cluster.rms_per_marker))]}, "
        f"{millimetres(float(cluster.rms_per_marker.max())):.2f} mm)"
    )
    out.print(
        f"Placing     lengths constant to {millimetres(chosen.rigid.rms):.2f} mm rms, with stretch "
        f"{millimetres(registration.rms):.2f} mm; the two verticals differ by {degrees(registration.tilt):.1f}°"
    )
    out.print(_arrangements(report))
    out.print(
        f"Clocks      log − markers {_milliseconds(chosen.clock)} by swivel angles; by inclinometer "
        f"{_milliseconds(chosen.inclinometer)}, by load cells {_milliseconds(chosen.load_cells)}: "
        "each includes that sensor's own delay"
    )
    _print_softness(report, out)
    out.print(_windows(report))
    out.print("The shortest windows are held out: long ones excite more of the modes.")
    out.print(f"Written to {report.folder}; next: fidim identify {report.folder}")


def _arrangements(report: ImportReport) -> Table:
    rows = [
        (
            f"{degrees(evidence.rigid.yaw):.0f}°",
            f"{millimetres(evidence.rigid.rms):.3f}",
            f"{millimetres(evidence.stretched.rms):.3f}",
            f"{evidence.stretched.compliance * 1e6:.0f}",
            f"{evidence.clock.correlation:.2f}",
            "chosen" if evidence is report.chosen else "",
        )
        for evidence in report.arrangements
    ]
    title = "Which way round? (swivel angles decide; a right arrangement stretches with tension)"
    names = ("yaw", "lengths, mm rms", "with stretch", "stretch, µm/N", "swivel correlation", "")
    return console.table(title, names, rows, left=0)


def _print_softness(report: ImportReport, out: Console) -> None:
    balance, freedoms = report.hand_free.balance, report.recording.robot.freedoms
    if balance.free_directions > freedoms:
        least, next_one = balance.singular_values[-1], balance.singular_values[-2]
        out.print(
            f"Soft mode   the cables hardly hold one direction (singular values of Ξ {least:.3f} and "
            f"{next_one:.2f}): {balance.free_directions} directions move, not {freedoms}; "
            "rigid cables are the wrong model here"
        )


def _windows(report: ImportReport) -> Table:
    pairs = zip(report.campaign.windows, report.hand_free.windows, strict=True)
    rows = [
        (w.id, f"{one.begin:.2f}", f"{one.end:.2f}", w.role.value, one.before.value, one.after.value)
        for w, one in pairs
    ]
    title = f"Hand-free windows ({len(report.hand_free.too_short)} shorter stretches left out)"
    names = ("window", "from, s", "to, s", "role", "begins after", "ends because")
    return console.table(title, names, rows, left=len(names))


def _milliseconds(clock: ClockOffset) -> str:
    return f"{clock.offset * 1e3:+.1f} ± {clock.sd * 1e3:.1f} ms"


def _arrangement(evidence: ArrangementEvidence, chosen: bool) -> dict[str, object]:
    return {
        "chosen": chosen,
        "yaw": evidence.rigid.yaw,
        "rms_rigid": evidence.rigid.rms,
        "rms_with_stretch": evidence.stretched.rms,
        "compliance": evidence.stretched.compliance,
        "power_explained_by_stretch": evidence.gain,
        "swivel_correlation": evidence.clock.correlation,
    }
