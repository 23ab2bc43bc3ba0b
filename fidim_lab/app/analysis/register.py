"""`fidim register`: where capture frame, markers and encoders stand against the robot file, told and put right."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.terminal import console
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Campaign
from fidim_lab.data.robot_file import write_robot
from fidim_lab.errors import RefusedError, SetupError
from fidim_lab.identification.calibration.register_campaign import (
    CURE,
    Registered,
    register_campaigns,
    registered_robot,
)
from fidim_lab.identification.cleaning.clean import without_bad_samples
from fidim_lab.identification.data_checks.placed import moved_in_words
from fidim_lab.identification.mle.encoder_zeros import anchors_by_encoders
from fidim_lab.identification.mle.geometry_words import encoders_say
from fidim_lab.units import plain

GOOD = 4.0
"""χ²/dof up to which the registered geometry explains markers and lengths: twice their noise"""


def register_command(folders: Sequence[Path], out: Path, json_file: Path | None) -> int:
    """Register, print, write. Returns the exit code: 1 where no registration explains the recordings.

    Raises FileError for a wrong campaign, SetupError for campaigns of several robots, RefusedError where nothing fits.
    """
    campaigns = [without_bad_samples(read_campaign(folder)).campaign for folder in folders]
    _refuse_several(campaigns, folders)
    try:
        found = register_campaigns(campaigns)
    except RefusedError as refusal:
        raise RefusedError(refusal.message + _by_encoders(campaigns), hint=refusal.hint) from refusal
    console.out.print(summary(campaigns[0], found))
    good = found.best.chi2_per_dof < GOOD
    if good:
        robot = registered_robot(campaigns[0].robot, found)
        write_robot(out, robot, comment=f"Registered by fidim register from {', '.join(map(str, folders))}.")
        console.out.print(f"Robot file  {out}", markup=False)
    write_answer(json_file, "fidim-registration/1", to_json(found))
    return 0 if good else 1


def _by_encoders(campaigns: Sequence[Campaign]) -> str:
    """What encoders with unknown zeros say of each campaign's anchors all the same."""
    heard = ((one, encoders_say(anchors_by_encoders([one]))) for one in campaigns)
    return "".join(f" {one.name}: {says}" for one, says in heard if says)


def _refuse_several(campaigns: Sequence[Campaign], folders: Sequence[Path]) -> None:
    first = campaigns[0].robot
    for campaign, folder in zip(campaigns, folders, strict=True):
        other = campaign.robot
        alike = other.n == first.n and len(other.markers) == len(first.markers)
        if not alike or not all(
            np.allclose(a.d, b.d) and np.allclose(a.a, b.a) for a, b in zip(other.cables, first.cables, strict=True)
        ):
            raise SetupError(f"{folder} has another robot file than {folders[0]}: register each robot by itself.")


def summary(campaign: Campaign, found: Registered) -> RenderableType:
    """What was tried, the registration, and what disagrees."""
    return Group(_tried(found), *map(Text, sentences(campaign, found)), _left(campaign, found))


def sentences(campaign: Campaign, found: Registered) -> list[str]:
    """The answer in words."""
    best, place = found.best, found.best.placement
    said = [f"{len(found.sample.markers)} instants were used. The recordings support fitting {found.free.says}."]
    unseen = sorted(set(range(len(campaign.robot.markers))) - set(found.sample.numbers))
    said += [
        f"Marker {m + 1} is seen in less than half of all samples: it stays where the robot file has it."
        for m in unseen
    ]
    if found.free.frame:
        turn, shift = (", ".join(f"{x:.2g}" for x in sd) for sd in (np.degrees(best.sd_turn), 1e3 * best.sd_shift))
        said.append(
            f"The capture frame against the robot's: {moved_in_words(place.turn, place.shift)} (± {turn} °, "
            f"± {shift} mm)."
        )
    if found.free.markers:
        for m, at, sd in zip(found.sample.numbers, place.body, best.sd_body, strict=True):
            said.append(f"Marker {m + 1} is at {_mm(at)} ± {_mm(sd)} mm of the body.")
    if found.free.zeros:
        said += [
            f"The encoder of cable {k + 1} reads {1e3 * zero:.2f} ± {1e3 * sd:.2g} mm too much: correct its zero."
            for k, (zero, sd) in enumerate(zip(place.zeros, best.sd_zeros, strict=True))
        ]
    said += [
        f"Anchor of cable {one.cable} disagrees: moved by {_mm(one.by)} mm it takes χ²/dof from "
        f"{plain(best.chi2_per_dof)} to {plain(one.chi2_per_dof)}."
        for one in found.suspects
        if best.chi2_per_dof > GOOD and one.chi2_per_dof < CURE * best.chi2_per_dof
    ]
    if best.chi2_per_dof >= GOOD:
        said.append(
            f"No registration explains the recordings (χ²/dof {plain(best.chi2_per_dof)}): geometry, lengths or order "
            "of cables are not as the robot file says. No robot file is written."
        )
    return said


def _tried(found: Registered) -> Table:
    rows = [(one.free.says, plain(one.placed.chi2_per_dof), plain(one.criterion)) for one in found.tried]
    return console.table("What was left open", ("free", "χ²/dof", "criterion (0: best)"), rows)


def _left(campaign: Campaign, found: Registered) -> Table:
    """Residuals by marker and by cable, and what each anchor would take away."""
    markers, lengths = ([f"{_rms(each):.3g}" for each in left.T] for left in (found.best.markers, found.best.lengths))
    rows = [(f"marker {m + 1}", left, "", "") for m, left in zip(found.sample.numbers, markers, strict=True)]
    rows += [
        (f"length of cable {k}", left, plain(one.chi2_per_dof), _mm(one.by))
        for k, (left, one) in enumerate(zip(lengths, found.suspects, strict=True), start=1)
    ]
    names = ("what", "mm", "χ²/dof with its anchor free", "anchor moved by, mm")
    return console.table("What is left, rms", names, rows)


def _rms(values: np.ndarray) -> float:
    return 1e3 * float(np.sqrt(np.mean(values**2)))


def _mm(values: np.ndarray) -> str:
    return f"({', '.join(f'{1e3 * x:.2f}' for x in values)})"


def to_json(found: Registered) -> dict[str, object]:
    """The format "fidim-registration/1", SI."""
    best, place = found.best, found.best.placement
    return {
        "free": found.free.says,
        "chi2_per_dof": best.chi2_per_dof,
        "instants": len(found.sample.markers),
        "frame": {
            "turn": place.turn,
            "shift": place.shift,
            "turn_sd": best.sd_turn,
            "shift_sd": best.sd_shift,
        },
        "markers": {
            "numbers": [m + 1 for m in found.sample.numbers],
            "at": place.body,
            "sd": best.sd_body,
        },
        "zeros": {"value": place.zeros, "sd": best.sd_zeros},
        "left_rms": {
            "markers": [_rms(best.markers[:, m]) / 1e3 for m in range(best.markers.shape[1])],
            "lengths": [_rms(best.lengths[:, k]) / 1e3 for k in range(best.lengths.shape[1])],
        },
        "anchors": [{"cable": one.cable, "by": one.by, "chi2_per_dof": one.chi2_per_dof} for one in found.suspects],
    }
