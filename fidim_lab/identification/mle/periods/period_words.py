"""Whether periods agree with each other, what is probably wrong where they do not, and the answer in words."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.stats import chi2

from fidim_lab.data.records import PARAMETER_NAMES, Body, Period
from fidim_lab.identification.equations import consistency
from fidim_lab.identification.mle.findings import Figures, not_known
from fidim_lab.identification.mle.spread import Combination
from fidim_lab.identification.results.result import ResultOutcome, ShortAnswer
from fidim_lab.say import counted
from fidim_lab.units import millimetres, plain

LINEAR = 2.0
"""times a period, up to which what the others foretell of it, which is to first order, means something"""
CHANCE = 1e-3
"""by which right readings contradict each other, or the robot file, so much"""


@dataclass(frozen=True, eq=False)
class Agreement:
    """How far readings are from what is foretold of them, in units of sd; the body as free as it is beforehand."""

    chi2: float
    """sum of squares of the best body, what is known of bodies beforehand among it"""
    pulls: Float[np.ndarray, " M"]
    """of each reading against what all others foretell, over the sd of both"""
    foretold: Float[np.ndarray, " M"]
    """ln s and rad, by the others …"""
    sd: Float[np.ndarray, " M"]
    """… and how well, its own sd included"""

    @staticmethod
    def of(
        cost: float,
        off: Float[np.ndarray, " M"],
        readings: Float[np.ndarray, " M"],
        covariance: Float[np.ndarray, "M M"],
    ) -> "Agreement":
        """Of readings and what is `off` in them against what is foretold beforehand.

        cost: of the best body. covariance: of `off`, by noise and by all bodies that are plausible.
        """
        inverse = np.linalg.inv(covariance)
        spread = 1 / np.sqrt(np.diag(inverse))
        pulls = (inverse @ off) * spread
        return Agreement(cost, pulls, readings - pulls * spread, spread)

    @property
    def clear(self) -> bool:
        """Whether it is no matter of chance: all together, or the farthest of so many."""
        many = len(self.pulls)
        farthest = many * float(chi2.sf(np.max(self.pulls**2), 1))
        return min(float(chi2.sf(self.chi2, many)), farthest) < CHANCE

    @property
    def ratio(self) -> float:
        """rms of what is left over what is expected."""
        return float(np.sqrt(self.chi2 / len(self.pulls)))

    def says(self, periods: Sequence[Period], mends: Sequence[str]) -> str:
        """What is probably wrong, as a sentence or two; mends: with which all would agree."""
        k = int(np.argmax(np.abs(self.pulls)))
        if k < len(periods):
            one, ratio = periods[k], float(self.foretold[k] - np.log(periods[k].value))
            said = f"Farthest off is period {k + 1} ({one.name}): {one.value:.5g} s, "
            if abs(ratio) < np.log(LINEAR):
                by_others = one.value * float(np.exp(ratio))
                said += f"by all others {by_others:.5g} ± {plain(float(self.sd[k]) * by_others, 2)} s."
            else:
                said += "which no body like the nominal one has beside all others."
        else:
            said = "Farthest off is a tilt: is the inclinometer along the body's axes, and was the platform at rest?"
        return f"{said} All agree with {', or '.join(mends)}." if mends else said


@dataclass(frozen=True)
class Mend:
    """A mistake that people make, undone."""

    says: str
    """what is right then"""
    changes: Mapping[int, float]
    """index of a period → its ln s"""


def usual_mistakes(periods: Sequence[Period], readings: Float[np.ndarray, " M"]) -> tuple[Mend, ...]:
    """Swings that were miscounted by one, and motions of one hanging that were exchanged."""
    found = [
        Mend(f"{true} swings instead of {one.swings} in period {k + 1}", {k: readings[k] + np.log(one.swings / true)})
        for k, one in enumerate(periods)
        for true in (one.swings + 1, one.swings - 1)
        if true
    ]
    found += [
        Mend(f"the motions of periods {j + 1} and {i + 1} exchanged", {i: readings[j], j: readings[i]})
        for i, one in enumerate(periods)
        for j, other in enumerate(periods[:i])
        if one.motion and other.motion and one.motion != other.motion and np.array_equal(one.lengths, other.lengths)
    ]
    return tuple(found)


def answer(
    outcome: ResultOutcome, figures: Figures, judged: Agreement, periods: Sequence[Period], mends: Sequence[str]
) -> ShortAnswer:
    """In four parts for a person."""
    check = f"χ²/dof is {plain(judged.chi2 / len(judged.pulls))}"
    certain = f"{counted(len(periods), 'period')} used; {check}. {consistency.sentence(figures.body)}"
    if judged.clear:
        verdict = f"The periods contradict each other, or the robot file. {judged.says(periods, mends)}"
        advice = "Correct the period, its motion or its count, or measure it again."
        return ShortAnswer(verdict, certain, not_known(figures), advice)
    more = "Time other motions, hang it at other lengths, read the tilt at rest; rates or markers show more."
    return ShortAnswer(outcome.value, certain, not_known(figures), outcome.next if outcome.good else more)


def warnings(
    periods: Sequence[Period],
    combinations: Sequence[Combination],
    rivals: Sequence[Body],
    vague: Sequence[int],
    unnoted: float,
    *,
    unsurveyed: bool,
) -> tuple[str, ...]:
    """What a person should know before believing the numbers.

    combinations: of parameters, that are open. rivals: bodies nearly as likely as the best, it first.
    vague: indices of periods whose motion several modes do. unnoted: rad, of amplitudes that nobody noted.
    """
    said = [f"The periods do not determine {one}." for one in combinations]
    if len(rivals) > 1:
        bodies = "; ".join(_differing(one, rivals) for one in rivals)
        said.append(
            f"{len(rivals)} different bodies have these periods nearly as well: {bodies}. Each ± "
            "covers them all; the tilt at rest, or other lengths, tell them apart."
        )
    for k in vague:
        said.append(
            f"Period {k + 1}: several swings of this body are {periods[k].motion!r} as much, so which one was timed is "
            "uncertain. Leave its motion blank if you are not sure."
        )
    if unsurveyed:
        said.append("The robot file has no [survey]: every ± assumes a usual one (1 mm anchors, 0.5 mm attachments).")
    without = [str(k) for k, one in enumerate(periods, start=1) if one.amplitude is None]
    if without:
        said.append(f"No amplitude is stated of period {', '.join(without)}: what {unnoted:g} rad adds is in the ±.")
    return tuple(said)


def _differing(body: Body, rivals: Sequence[Body]) -> str:
    """The two parameters in which the bodies differ most, of one of them."""
    values = np.array([one.vector for one in rivals])
    size = np.abs(values).max(axis=0)
    kinds = np.concatenate([np.full(3, size[:3].max()), np.full(6, size[3:].max())])
    most = np.sort(np.argsort(np.ptp(values, axis=0) / kinds)[-2:])
    return ", ".join(
        f"{PARAMETER_NAMES[k]} {millimetres(float(body.vector[k])):.3g}{' mm' if k < 3 else 'e-3 m²'}" for k in most
    )
