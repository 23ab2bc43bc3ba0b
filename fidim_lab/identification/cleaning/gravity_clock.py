"""Whether time runs as the stamps say: gravity is known, and so is a clock.

A file whose rate is wrong by a factor (every second frame exported, a header of 200 Hz above samples of 100 Hz) has
accelerations that are wrong by its square, beside a gravity that is not. So the equations of motion that need no cable
force (`balance`) are balanced for clocks of many speeds, each with its own body, in the better half of all seconds. A
small error (59.94 written as 60) is mostly taken up by the body: that is for the fits to weigh.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Campaign
from fidim_lab.errors import RefusedError
from fidim_lab.identification.cleaning.balance import WindowBalance, balances_of, blocks
from fidim_lab.model.regressor import parameter_vector

SPEEDS = np.geomspace(0.1, 10.0, 81)
"""that are tried, 6 % apart; 1 is among them"""
COARSE = 5
"""every so many are tried first: 33 % apart, less than `OFF`"""
ALIKE = 1.1
"""times the least that may be left over; of such clocks the one nearest to the stamps is named. Slower clocks than the
true one differ little where windows are short, since gravity alone is then balanced"""
OFF = 1.4
"""factor below which it may be the model: up to 1.2 with elastic cables and other effects, and a right rate"""
CLEARER = 2.0
"""times as much must be left over with the stamps as they are: 1.0 to 1.7 where nothing is wrong (60 takes of `grab`,
IRMA4U, effects of the catalogue), 2.6 to 11 where the rate is wrong by a factor of 2, in five windows of 3 or 12 s"""
BALANCED = 0.3
"""of the inertial forces: with more left over, nothing balances, and no clock is known"""
TINY = float(np.finfo(float).tiny)
ROUNDS = 3
"""of least trimmed squares"""
UNSURE = 0.5
"""of its size, by which CAD may miss the body"""
MISSED = 0.1
"""of the inertial forces: a body that misses CAD by `UNSURE` counts as if so much were left over. Without this, slow
clocks fit with bodies that gravity hardly turns"""


@dataclass(frozen=True)
class GravityClock:
    """A speed of the clock with which the motion balances."""

    factor: float
    """true time over that of the stamps"""
    left_over: float
    """of the inertial forces, with it"""
    as_stamped: float
    """of the inertial forces, with the stamps as they are"""

    def says(self, rate: float) -> str:
        """For people; rate: as stated, Hz."""
        return (
            f"By gravity, time runs {self.factor:.2g} times as long as stated: at {rate:.4g} Hz {self.as_stamped:.0%} "
            f"of the inertial forces have no cause, at about {rate / self.factor:.3g} Hz {self.left_over:.0%}"
        )


def refuse_other_clock(campaign: Campaign, balances: Sequence[WindowBalance]) -> None:
    """Raises RefusedError where gravity says another clock than the stamps; balances: of the campaign's windows."""
    found = gravity_clock(campaign, balances)
    if found is None:
        return
    hint = (
        "Correct the column t of the windows and sample_rate (or give --rate when importing), or gravity in the robot"
    )
    raise RefusedError(f"{found.says(campaign.sample_rate)}.", hint=f"{hint} file.")


def gravity_clock(campaign: Campaign, known: Sequence[WindowBalance] | None = None) -> GravityClock | None:
    """The clock by gravity where it is not that of the stamps, by far and clearly; else None.

    known: the windows' `balances_of`, computed here unless given.
    """
    nominal = parameter_vector(campaign.robot.nominal)
    seconds = [block for one in (balances_of(campaign) if known is None else known) for block in blocks(one, 1.0)]
    if not seconds:
        return None
    grams = np.array([_gram(left, inertial, nominal) for left, inertial in seconds])
    as_stamped = _left_over(grams, nominal, 1.0)
    if as_stamped < CLEARER * min(_left_over(grams, nominal, speed) for speed in SPEEDS[::COARSE]) / ALIKE:
        return None
    left_over = np.array([_left_over(grams, nominal, speed) for speed in SPEEDS])
    away = np.where(left_over <= ALIKE * left_over.min(), np.abs(np.log(SPEEDS)), np.inf)
    best = int(np.argmin(away))
    found = GravityClock(float(SPEEDS[best]), float(left_over[best]), as_stamped)
    off = max(found.factor, 1.0 / found.factor) > OFF
    clear = found.left_over < BALANCED and found.as_stamped > CLEARER * found.left_over
    return found if off and clear else None


def _gram(left: Float[np.ndarray, "R 10"], inertial: Float[np.ndarray, "R 10"], chi: np.ndarray) -> np.ndarray:
    """(20, 20) of inertial forces and gravity, of a block in units of its own inertial forces."""
    both = np.concatenate([inertial, left - inertial], axis=1)
    return both.T @ both / max(float(((inertial @ chi) ** 2).sum()), TINY)


def _left_over(grams: Float[np.ndarray, "B 20 20"], nominal: np.ndarray, speed: float) -> float:
    """Of the inertial forces, with a clock of this speed and the body that fits best, in the better half of blocks."""
    slower = np.vstack([np.eye(10) / speed**2, np.eye(10)])
    all_forces, inertial = slower.T @ grams @ slower, grams[:, :10, :10] / speed**4
    size = float(np.mean(np.abs(nominal[4:7])))
    arm = max(float(np.linalg.norm(nominal[1:4])), float(np.sqrt(size)))
    unsure = UNSURE * np.array([arm] * 3 + [size] * 6)
    chi, share, kept = nominal, np.zeros(len(grams)), np.arange(len(grams))
    for _ in range(ROUNDS):
        table = all_forces[kept].mean(axis=0)
        prior = MISSED**2 * float(nominal @ inertial[kept].mean(axis=0) @ nominal) / unsure**2
        known = prior * nominal[1:] - table[1:, 0]
        chi = np.concatenate([[1.0], np.linalg.solve(table[1:, 1:] + np.diag(prior), known)])
        share = np.maximum(all_forces @ chi @ chi, 0.0) / np.maximum(inertial @ chi @ chi, TINY)
        kept = np.argsort(share)[: (len(grams) + 1) // 2]
    away = float(np.sum(((chi - nominal)[1:] / unsure) ** 2))
    return float(np.sqrt(np.mean(share[kept]) + MISSED**2 * away))
