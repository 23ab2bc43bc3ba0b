"""From opened answers to figures: confusion, shares by loudness, false alarms, detection limits, parameter errors."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.sealed.cases import SecretKind
from benchmarks.sealed.folder import Json
from benchmarks.sealed.scoring import Marked, covers, grade, grade_surveyed, grade_without, named, sure
from benchmarks.sealed.statistics import DetectionLimit, Share, detection_limit
from fidim_lab.data.records import PARAMETER_NAMES

BANDS = (("≥ 1000", 1000.0, np.inf), ("100 – 1000", 100.0, 1000.0), ("< 100", 0.0, 100.0))
"""of the expected excess of χ²"""
WITH_EFFECTS = (SecretKind.ONE, SecretKind.TWO, SecretKind.THREE)


@dataclass(frozen=True)
class ScoredCampaign:
    """One campaign, opened."""

    name: str
    kind: SecretKind
    label: tuple[str, ...]
    hidden: tuple[Json, ...]
    """id, size, unit, hide"""
    cable: int | None
    named: str
    named_ids: tuple[str, ...]
    grade: Marked
    why: str
    """where there is no answer"""
    chi2_excess: float | None
    """None where it could not be measured"""
    faintest: float | None
    """excess of χ² that the faintest of the hidden effects brings alone"""
    rms_mm: float | None
    held_out: tuple[float | None, float | None]
    """χ²/dof before and after"""
    errors: tuple[float, float] | None
    """rms of the nine parameters' errors in their own sd, before and after"""
    cpu: float
    """s"""
    backend: str
    survey_mm: float = 0.0
    """how far the robot file is off, one sd of a coordinate of an anchor"""
    sure: bool = False
    """whether something that was not hidden has the only name"""
    covered: bool | None = None
    """whether all that is hidden stands among what is named and what is not told from it; None: nothing is named"""

    @property
    def world(self) -> str:
        """Where it was recorded."""
        return f"{self.backend}, robot file off" if self.survey_mm else self.backend

    @property
    def band(self) -> str:
        """Name of its band, or «unmeasured»."""
        if self.faintest is None:
            return "unmeasured"
        return next(name for name, low, high in BANDS if low <= self.faintest < high)

    @property
    def halved(self) -> bool:
        """Whether what is modelled takes at least half of the held-out windows' excess of χ²/dof."""
        before, after = self.held_out
        return before is not None and after is not None and after - 1.0 <= 0.5 * (before - 1.0)


def judged(name: str, truth: Json, answer: Json, loud: Json | None, *, without: bool = False) -> ScoredCampaign:
    """One campaign from its files: the truth, the child's outcome of explaining, the one of measuring loudness.

    without: the catalogue lacked what is hidden.
    """
    case, explanation = truth["case"], answer["answer"]
    measured = None if loud is None else loud["answer"]
    label, cable = case["label"], case.get("cable")
    held = {} if explanation is None else explanation.get("held_out", {}).get("chi2_per_dof", {})
    effects = [] if explanation is None else explanation["effects"]
    survey_mm = truth.get("survey_mm", 0.0)
    if without:
        grade_of = grade_without(explanation, label[0], cable)
    else:
        grade_of = (grade_surveyed if survey_mm else grade)(explanation, label, cable)
    return ScoredCampaign(
        name=name,
        kind=SecretKind(truth["kind"]),
        label=tuple(label),
        hidden=tuple(truth["hidden"]),
        cable=cable,
        named=named(explanation),
        named_ids=tuple(effect["id"] for effect in effects),
        grade=grade_of,
        why=answer["why"],
        chi2_excess=None if measured is None else measured["chi2_excess"],
        faintest=_faintest(loud),
        rms_mm=None if measured is None else measured["rms_mm"],
        held_out=(held.get("before"), held.get("after")),
        errors=None if explanation is None else _errors(explanation, [*truth["s"], *truth["I"]]),
        cpu=answer["cpu"],
        backend=truth["backend"],
        survey_mm=survey_mm,
        sure=sure(explanation, label),
        covered=covers(explanation, label),
    )


def _faintest(loud: Json | None) -> float | None:
    """The least excess of χ² of the effects alone; None where one could not be measured."""
    parts = [] if loud is None else loud["each"]
    return min((part["chi2_excess"] for part in parts), default=None) if all(parts) else None


def _errors(explanation: Json, true: list[float]) -> tuple[float, float] | None:
    """rms over the nine parameters of error/sd, before and after; None where a standard deviation is missing."""
    found: list[float] = []
    for tables in (explanation["parameters_before"], explanation["parameters"]):
        values = [tables.get(name, {}) for name in PARAMETER_NAMES]
        if not all(value.get("sd") and value.get("value") is not None for value in values):
            return None
        z = [(value["value"] - t) / value["sd"] for value, t in zip(values, true, strict=True)]
        found.append(float(np.sqrt(np.mean(np.square(z)))))
    return found[0], found[1]


@dataclass(frozen=True)
class Tally:
    """All campaigns together."""

    campaigns: tuple[ScoredCampaign, ...]

    @property
    def false_alarms(self) -> Share:
        """On campaigns with nothing hidden."""
        nulls = self.of(lambda c: c.kind is SecretKind.NOTHING)
        return Share(sum(not c.grade.good for c in nulls), len(nulls))

    @property
    def wrong_and_sure(self) -> Share:
        """Campaigns in which something that was not hidden has the only name."""
        return Share(sum(c.sure for c in self.campaigns), len(self.campaigns))

    @property
    def covered(self) -> Share:
        """Of those with hidden effects of the catalogue, some of them named: all hidden ones stand in what is told."""
        told = self.of(lambda c: c.covered is not None and c.kind in WITH_EFFECTS)
        return Share(sum(bool(c.covered) for c in told), len(told))

    @property
    def outside(self) -> Share:
        """Flagged as unknown, of those whose secret is outside the catalogue."""
        return self.share(lambda c: c.kind is SecretKind.OUTSIDE)

    @property
    def halved(self) -> Share:
        """Of those flagged as unknown: whose held-out excess is at least halved."""
        flagged = self.of(lambda c: c.kind is SecretKind.OUTSIDE and c.grade.good)
        return Share(sum(c.halved for c in flagged), len(flagged))

    def of(self, which: Callable[[ScoredCampaign], bool]) -> tuple[ScoredCampaign, ...]:
        """Some of the campaigns."""
        return tuple(c for c in self.campaigns if which(c))

    def share(self, which: Callable[[ScoredCampaign], bool]) -> Share:
        """How many of some are right, or right by class."""
        chosen = self.of(which)
        return Share(sum(c.grade.good for c in chosen), len(chosen))

    def in_band(self, band: str) -> tuple[ScoredCampaign, ...]:
        """Campaigns with something hidden from the catalogue, in one band of loudness."""
        return self.of(lambda c: c.band == band and c.kind in (*WITH_EFFECTS, SecretKind.FAULT))

    def outside_in(self, band: str) -> tuple[ScoredCampaign, ...]:
        """Campaigns with something hidden that is outside the catalogue, in one band of loudness."""
        return self.of(lambda c: c.band == band and c.kind is SecretKind.OUTSIDE)

    @property
    def confusion(self) -> dict[tuple[str, str], int]:
        """(hidden, named) → number, over campaigns with at most one secret; names without cables, with the verdict."""
        pairs = Counter[tuple[str, str]]()
        for c in self.of(lambda c: c.kind not in (SecretKind.TWO, SecretKind.THREE)):
            pairs[c.hidden[0]["id"] if c.hidden else "nothing", " + ".join(c.named_ids) or c.named] += 1
        return dict(sorted(pairs.items()))

    def limits(self) -> dict[str, tuple[int, DetectionLimit | None, DetectionLimit | None, str]]:
        """id → (campaigns, limit in the effect's unit, in mm of trajectory, unit), from campaigns with one secret."""
        found: dict[str, tuple[int, DetectionLimit | None, DetectionLimit | None, str]] = {}
        single = self.of(lambda c: len(c.hidden) == 1)
        for id in sorted({c.hidden[0]["id"] for c in single}):
            of_id = [c for c in single if c.hidden[0]["id"] == id]
            sizes = np.array([c.hidden[0]["size"] for c in of_id])
            measured = [c for c in of_id if c.rms_mm]
            found[id] = (
                len(of_id),
                detection_limit(sizes, _good(of_id)),
                detection_limit(np.array([c.rms_mm for c in measured], dtype=float), _good(measured)),
                str(of_id[0].hidden[0]["unit"]),
            )
        return found

    def errors(self) -> tuple[float, float] | None:
        """Medians over campaigns with effects that were explained rightly: parameter error in sd before and after."""
        pairs = [c.errors for c in self.of(lambda c: c.grade.good and bool(c.named_ids)) if c.errors is not None]
        if not pairs:
            return None
        before, after = np.median(np.array(pairs), axis=0)
        return float(before), float(after)

    @property
    def table(self) -> dict[str, Any]:
        """As `--json` writes it, "fidim-benchmark/1"."""
        alarms, outside = self.false_alarms, self.outside
        return {
            "format": "fidim-benchmark/1",
            "benchmark": "explain",
            "campaigns": len(self.campaigns),
            "grades": dict(Counter(c.grade.value for c in self.campaigns)),
            "bands": {name: dict(Counter(c.grade.value for c in self.in_band(name))) for name in BAND_NAMES},
            "false_alarms": {"alarms": alarms.good, "nulls": alarms.all, "interval": alarms.interval},
            "wrong_and_sure": self.wrong_and_sure.good,
            "covered": {"all": self.covered.good, "campaigns": self.covered.all, "interval": self.covered.interval},
            "outside": {
                "flagged": outside.good,
                "campaigns": outside.all,
                "interval": outside.interval,
                "halved": self.halved.good,
                "bands": {name: dict(Counter(c.grade.value for c in self.outside_in(name))) for name in BAND_NAMES},
            },
            "confusion": [{"hidden": h, "named": n, "count": k} for (h, n), k in self.confusion.items()],
            "detection_limits": {
                id: {"campaigns": count, "unit": unit, "size": _limit(size), "mm": _limit(mm)}
                for id, (count, size, mm, unit) in self.limits().items()
            },
            "parameter_errors_sd": self.errors(),
            "each": [_campaign(c) for c in self.campaigns],
        }


BAND_NAMES = (*(name for name, _, _ in BANDS), "unmeasured")


def _good(campaigns: list[ScoredCampaign]) -> np.ndarray:
    return np.array([c.grade.good for c in campaigns], dtype=bool)


def _limit(limit: DetectionLimit | None) -> Json | None:
    return None if limit is None else vars(limit)


def _campaign(c: ScoredCampaign) -> Json:
    return {
        "name": c.name,
        "kind": c.kind.value,
        "hidden": [hidden["hide"] for hidden in c.hidden],
        "named": c.named,
        "grade": c.grade.value,
        "why": c.why,
        "chi2_excess": c.chi2_excess,
        "faintest_chi2_excess": c.faintest,
        "rms_mm": c.rms_mm,
        "held_out_chi2_per_dof": list(c.held_out),
        "parameter_errors_sd": c.errors,
        "cpu_seconds": c.cpu,
        "backend": c.backend,
        "survey_mm": c.survey_mm,
        "sure": c.sure,
    }
