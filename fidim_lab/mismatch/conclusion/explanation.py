"""The result of `explain`, and its file "fidim-explanation/1" (spec/formats.md)."""

from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from fidim_lab.data.files.json_file import as_json, write_json
from fidim_lab.identification.results.result import Geometry, ShortAnswer
from fidim_lab.mismatch.conclusion.parts import Before, EffectParameter, HeldOutFigures, LawTerm, Ranked
from fidim_lab.mismatch.conclusion.unknown_table import unknown_table
from fidim_lab.mismatch.residuals.channels import Channel
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.mismatch.unknown_force.unknown import UnknownForce
from fidim_lab.model.sensitivity.work import IntegrationWork

MOST_ALIKE = 3
"""effects in `equivalent_to` of the file, by spec/formats.md; the others are in `further_equivalent`"""


class Verdict(StrEnum):
    """The verdict on the difference between recording and model."""

    NOTHING_MISSING = "nothing-missing"
    EXPLAINED = "explained"
    PARTLY_EXPLAINED = "partly-explained"
    UNKNOWN_PHYSICS = "unknown-physics"
    SENSOR_FAULT = "sensor-fault"


@dataclass(frozen=True)
class ClassMember:
    """Another effect that may stand in the place of a named one."""

    id: str
    cable: int | None
    loss: float
    """nats by which it says less; below 0 it says more"""
    parameters: dict[str, EffectParameter]
    """the size at which it comes nearest"""


@dataclass(frozen=True)
class NamedCause:
    """One effect that was left out."""

    id: str
    cable: int | None
    """1-based"""
    equivalent_to: tuple[str, ...]
    """all that these data cannot tell it from, the most alike first"""
    parameters: dict[str, EffectParameter]
    says: str
    """with the formula"""
    members: tuple[ClassMember, ...] = ()
    """those of `equivalent_to` whose size is known, the most alike first"""
    single: bool = False
    """odds over 20 against every rival, general geometry among them"""
    windows: dict[str, float] = field(default_factory=dict[str, float])
    """of what differs between windows: times which each, by its id, has the parameters"""

    @property
    def weights(self) -> tuple[float, ...]:
        """Posterior weight of it and of each member, by evidence alone: they add up to 1."""
        said = np.exp(-np.array([0.0, *(one.loss for one in self.members)]))
        return tuple((said / said.sum()).tolist())

    @property
    def likely(self) -> tuple[ClassMember, ...]:
        """The fewest members with which it holds 95 % of the weight."""
        held = np.cumsum(self.weights)
        return tuple(one for one, before in zip(self.members, held, strict=False) if before < SHARED.confidence)


@dataclass(frozen=True)
class Reading:
    """What differs from window to window: lengths, cameras, their noise, or the body."""

    id: str
    cable: int | None
    """1-based"""
    equivalent_to: tuple[str, ...]
    """other differences that odds of 20 do not exclude"""
    parameters: dict[str, EffectParameter]
    says: str
    next: str
    """what to do about it"""


@dataclass(frozen=True)
class MismatchPlace:
    """The place of a mismatch."""

    window: str
    t: tuple[float, float]
    """s on the window's own clock"""
    channel: str
    frequency: float | None
    """Hz"""
    share: float
    """of the whole excess"""
    says: str


@dataclass(frozen=True)
class BodyParameter:
    """One of the nine base parameters."""

    value: float
    sd: float
    nominal: float


@dataclass(frozen=True)
class Explanation:
    """The whole answer."""

    campaign: str
    verdict: Verdict
    effects: tuple[NamedCause, ...]
    where: tuple[MismatchPlace, ...]
    chi2_per_dof: Before
    """held out"""
    rms_mm: Before
    """held out"""
    ranking: tuple[Ranked, ...]
    parameters: dict[str, BodyParameter]
    parameters_before: dict[str, BodyParameter]
    next_experiment: str | None
    message: str
    seconds: float
    untested: tuple[str, ...] = ()
    """ids of the catalogue that this version could not test"""
    unknown: UnknownForce | None = None
    """the generic model of what has no name, where one helps"""
    law: tuple[LawTerm, ...] = ()
    """where a law without a name predicts as well as any wrench, its terms: figures and parameters are theirs"""
    geometry: Geometry | None = None
    """what was left open of the robot file's, and where the recordings have it; None where it counts as exact"""
    answer: ShortAnswer | None = None
    """in four short parts"""
    test: HeldOutFigures | None = None
    """of the windows of role `test`, opened once with the model that is told; None without any"""
    left_out: HeldOutFigures | None = None
    """of all windows, each foretold by the others; None where `test` stands for them"""
    channels: tuple[Channel, ...] = ()
    """what each shows beside the model that is told"""
    work: IntegrationWork = field(default_factory=IntegrationWork)
    """of the search"""
    readings: tuple[Reading, ...] = ()
    """what lengths and cameras were off by, put right in the fit; and noise that is not as stated"""

    @property
    def weights(self) -> list[tuple[tuple[tuple[str, int | None], ...], float]]:
        """Models (effects, each with its cable) that together hold 95 % of the weight, the likeliest first.

        Each effect or what may stand in its place, whatever the others are; none where it is not known what is missing.
        """
        if not self.effects and self.verdict is not Verdict.NOTHING_MISSING:
            return []
        told: list[tuple[tuple[tuple[str, int | None], ...], float]] = [((), 1.0)]
        for cause in self.effects:
            places = zip((cause, *cause.members), cause.weights, strict=True)
            told = [((*before, (one.id, one.cable)), weight * own) for one, own in places for before, weight in told]
        told.sort(key=lambda model: -model[1])
        held = np.cumsum([0.0, *(weight for _, weight in told)])
        return [model for model, before in zip(told, held, strict=False) if before < SHARED.confidence]

    @property
    def table(self) -> dict[str, Any]:
        """As spec/formats.md has it."""
        table = {
            "format": "fidim-explanation/1",
            "campaign": self.campaign,
            "verdict": self.verdict,
            "effects": [_effect(effect) for effect in self.effects],
            "where": self.where,
            "held_out": HeldOutFigures(self.chi2_per_dof, self.rms_mm),
            "ranking": self.ranking,
            "parameters": self.parameters,
            "parameters_before": self.parameters_before,
            "next_experiment": self.next_experiment,
            "message": self.message,
            "seconds": round(self.seconds, 2),
            "untested": self.untested,
            "unknown": None if self.unknown is None else unknown_table(self.unknown),
            "law": self.law,
            "geometry": None if self.geometry is None else self.geometry.table,
            "weights": [
                {"effects": [{"id": id, "cable": cable} for id, cable in effects], "weight": weight}
                for effects, weight in self.weights
            ],
            "channels": self.channels,
            "test": self.test,
            "left_out": self.left_out,
            "work": self.work,
            "readings": self.readings,
            **({} if self.answer is None else _parts(self.answer)),
        }
        return as_json(table)


def write_explanation(path: Path, explanation: Explanation) -> None:
    """Write the file; numbers that are not finite become null. Raises OSError."""
    write_json(path, explanation.table)


def _effect(cause: NamedCause) -> dict[str, Any]:
    return {
        "id": cause.id,
        "cable": cause.cable,
        "equivalent_to": cause.equivalent_to[:MOST_ALIKE],
        "further_equivalent": cause.equivalent_to[MOST_ALIKE:],
        "parameters": cause.parameters,
        "says": cause.says,
        "single": cause.single,
        "windows": cause.windows,
        "weight": cause.weights[0],
        "members": [
            {**vars(one), "weight": weight} for one, weight in zip(cause.members, cause.weights[1:], strict=True)
        ],
    }


def _parts(answer: ShortAnswer) -> dict[str, str]:
    """As spec/formats.md has them; the verdict's own sentence beside the verdict."""
    return {
        "says": answer.verdict,
        "certain": answer.certain,
        "not_told_apart": answer.not_known,
        "next": answer.next,
    }
