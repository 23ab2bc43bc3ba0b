"""What several campaigns of one platform have in common: anchors, attachments, markers, gravity.

A piece is common where the robot files give the cable the same name, or, where they give none, the same place within
their survey. Anchor and attachment are judged apart: a cable may be tied elsewhere, and an anchor may serve two robots.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fidim_lab.data.records import Campaign, Robot
from fidim_lab.errors import SetupError
from fidim_lab.identification.survey import EXACT, Nuisance, nuisances, typical
from fidim_lab.units import millimetres

WITHIN = 5.0
"""standard deviations of the difference of two surveys up to which they may be of one place"""
ROUNDING = 1e-6
"""m (and m/s² of gravity) by which two files may differ in what both call exact"""
SAME_MASS = 1e-3
"""share by which masses of one platform may differ between files"""

Key = tuple[str | int, ...]
"""what one piece of geometry is, for all campaigns that have it"""


@dataclass(frozen=True, eq=False)
class Common:
    """Campaigns whose robots agree on what they share, and which pieces these are."""

    campaigns: tuple[Campaign, ...]
    """robots changed so that common pieces begin at one place, the mean of the files"""
    anchors: tuple[tuple[int, ...], ...]
    """for each campaign and cable the number of its anchor among all different ones"""
    attachments: tuple[tuple[int, ...], ...]
    markers: tuple[tuple[int, ...], ...]
    gravities: tuple[int, ...]

    def key(self, member: int, piece: Nuisance) -> Key:
        """By which a piece of one campaign's geometry is known among all."""
        cable = 0 if piece.cable is None else piece.cable - 1
        if piece.what in ("anchor", "axis", "radius"):
            return piece.what, self.anchors[member][cable]
        if piece.what == "attachment":
            return piece.what, self.attachments[member][cable]
        if piece.what == "marker":
            return piece.what, self.markers[member][getattr(piece.effect, "number", 1) - 1]
        if piece.what == "gravity":
            return piece.what, self.gravities[member]
        return piece.what, member, cable

    @property
    def nothing_shared(self) -> bool:
        """Whether no two campaigns have a piece of geometry in common."""
        return all(
            len({k for of_one in numbers for k in of_one}) == sum(len(of_one) for of_one in numbers)
            for numbers in (self.anchors, self.attachments, self.markers)
        )

    def shared(self) -> tuple[str, ...]:
        """The common parts of two or more campaigns, one phrase each."""
        said: list[str] = []
        for kind, numbers in (("anchors", self.anchors), ("attachments", self.attachments), ("markers", self.markers)):
            seen = [k for of_one in numbers for k in set(of_one)]
            common = sum(seen.count(k) > 1 for k in set(seen))
            said.append(f"{common} of {len(set(seen))} {kind}")
        return tuple(said)


def open_geometry(robot: Robot, factor: float) -> tuple[Nuisance, ...]:
    """The open geometry of a robot: by its own survey, or `factor` times a usual one where its file has none."""
    return nuisances(robot, typical(robot).scaled(factor) if robot.survey is None else robot.survey)


def in_common(campaigns: Sequence[Campaign]) -> Common:
    """Find what campaigns share; see the module. Raises SetupError where they cannot be of one platform."""
    _refuse_masses(campaigns)
    robots = [campaign.robot for campaign in campaigns]
    names = [[(cable.name,) for cable in robot.cables] for robot in robots]
    known = [robot.survey or typical(robot) for robot in robots]
    anchors = [[cable.d for cable in robot.cables] for robot in robots]
    attachments = [[cable.a for cable in robot.cables] for robot in robots]
    unnamed = [[("",) for _ in robot.markers] for robot in robots]
    marker_sd = [np.full((len(r.markers), 3), max(s.marker, EXACT)) for r, s in zip(robots, known, strict=True)]
    of_anchor = _matched(campaigns, "d", names, anchors, [survey.anchor for survey in known])
    of_attachment = _matched(campaigns, "a", names, attachments, [survey.attachment for survey in known])
    markers = _matched(campaigns, "marker", unnamed, [list(robot.markers) for robot in robots], marker_sd)
    gravity_sd = [np.full((1, 3), 9.81 * max(s.gravity, EXACT)) for s in known]
    gravity = _matched(campaigns, "gravity", [[("",)]] * len(robots), [[r.gravity] for r in robots], gravity_sd)
    changed: list[Campaign] = []
    for c, campaign in enumerate(campaigns):
        cables = tuple(
            replace(cable, d=of_anchor.means[of_anchor.ids[c][k]], a=of_attachment.means[of_attachment.ids[c][k]])
            for k, cable in enumerate(campaign.robot.cables)
        )
        changed.append(replace(campaign, robot=replace(campaign.robot, cables=cables)))
    return Common(tuple(changed), of_anchor.ids, of_attachment.ids, markers.ids, tuple(ids[0] for ids in gravity.ids))


@dataclass(frozen=True, eq=False)
class _Matched:
    ids: tuple[tuple[int, ...], ...]
    means: tuple[np.ndarray, ...]


def _matched(
    campaigns: Sequence[Campaign],
    key: str,
    names: Sequence[Sequence[tuple[str]]],
    places: Sequence[Sequence[np.ndarray]],
    sds: Sequence[np.ndarray],
) -> _Matched:
    """A number for each different place; those of one campaign are always different."""
    seen: list[tuple[str, list[np.ndarray], np.ndarray, str]] = []
    ids: list[tuple[int, ...]] = []
    for campaign, of_names, of_places, of_sds in zip(campaigns, names, places, sds, strict=True):
        mine: list[int] = []
        before = len(seen)
        for (name,), place, sd in zip(of_names, of_places, of_sds, strict=True):
            taken = [k for k in range(before) if k not in mine]
            by_name = [k for k in taken if name and seen[k][0] == name]
            near = [k for k in taken if not (name and seen[k][0]) and _agree(seen[k][1][0], place, seen[k][2], sd)]
            if by_name and not _agree(seen[by_name[0]][1][0], place, seen[by_name[0]][2], sd):
                _refuse_name(campaign, key, name, place, seen[by_name[0]], sd)
            found = (by_name or near or [None])[0]
            if found is None:
                found = len(seen)
                seen.append((name, [], sd, campaign.name))
            seen[found][1].append(place)
            mine.append(found)
        ids.append(tuple(mine))
    return _Matched(tuple(ids), tuple(np.mean(of, axis=0) for _, of, _, _ in seen))


def _agree(one: np.ndarray, other: np.ndarray, sd: np.ndarray, other_sd: np.ndarray) -> bool:
    return bool((np.abs(one - other) <= WITHIN * np.hypot(sd, other_sd) + ROUNDING).all())


def _refuse_name(
    campaign: Campaign,
    key: str,
    name: str,
    place: np.ndarray,
    known: tuple[str, list[np.ndarray], np.ndarray, str],
    sd: np.ndarray,
) -> None:
    apart = millimetres(float(np.abs(known[1][0] - place).max()))
    allowed = millimetres(float((WITHIN * np.hypot(known[2], sd)).max()))
    raise SetupError(
        f"cable {name!r}, {key}: robot files of {known[3]} and {campaign.name} differ by {apart:.3g} mm; "
        f"{allowed:.3g} mm are allowed by their survey.",
        hint="Give what is not the same cable another name, register both in one frame, or state a wider [survey].",
    )


def _refuse_masses(campaigns: Sequence[Campaign]) -> None:
    first = campaigns[0]
    for campaign in campaigns[1:]:
        if abs(campaign.robot.mass / first.robot.mass - 1.0) > SAME_MASS:
            raise SetupError(
                f"platform, mass: {first.robot.mass:g} kg in {first.name}, {campaign.robot.mass:g} kg in "
                f"{campaign.name}; one body has one mass.",
                hint="Identify campaigns of other loads apart, or correct the robot file.",
            )
