"""What is hidden in each campaign of the benchmark: kinds from a shuffled deck, sizes log-uniform from faint to strong.

`case_of(seed, number)` depends on nothing else: campaign 17 is the same however many are made.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from benchmarks.sealed.sizes import EFFECTS, OUTSIDE, SIZES, Size
from fidim_lab.mismatch.linearised.hypotheses import NOT_BY_SCORE

Rng = np.random.Generator


class SecretKind(StrEnum):
    """What sort of secret a campaign has."""

    NOTHING = "nothing"
    ONE = "one effect"
    TWO = "two effects"
    THREE = "three effects"
    OUTSIDE = "outside the catalogue"
    FAULT = "sensor fault"


DECK: Mapping[SecretKind, int] = {
    SecretKind.NOTHING: 12,
    SecretKind.ONE: 22,
    SecretKind.TWO: 13,
    SecretKind.THREE: 4,
    SecretKind.OUTSIDE: 6,
    SecretKind.FAULT: 3,
}
"""how many of 60: of those with effects a third has two and a tenth three; 500 campaigns have 100 with nothing"""

NOT_TOGETHER = (
    {"constant-force", "gravity-tilt"},
    {"anchor-offset", "cable-length-bias"},
    {"marker-offset", "frame-misalignment"},
)
"""pairs of which spec/model.md says that no data separate them: hidden together their sum is one effect"""


@dataclass(frozen=True)
class Hidden:
    """One effect with its size."""

    id: str
    size: float
    unit: str
    keys: dict[str, float]
    """as `--hide` takes them, `cable` among them"""

    @property
    def hide(self) -> str:
        """As `fidim simulate --hide` takes it, to the last digit."""
        return self.id + ":" + ",".join(f"{key}={value!r}" for key, value in self.keys.items())


@dataclass(frozen=True)
class Case:
    """What one campaign hides."""

    kind: SecretKind
    effects: tuple[Hidden, ...]


def case_of(seed: int, number: int, mass: float, cables: int, kind: SecretKind | None = None) -> Case:
    """What campaign `number` (from 1) hides in a robot of this mass (kg) and cables; kind: of all, if given."""
    rng = np.random.default_rng([seed, number, 10])
    kind, ids = _dealt(seed, number, kind)
    return Case(kind, tuple(_sized(id, rng, mass, cables) for id in ids))


TURNS: Mapping[str, tuple[str, ...]] = {
    "each": tuple(id for id in EFFECTS if id not in NOT_BY_SCORE),
    "unlisted": tuple(OUTSIDE),
}
"""--without: effects that take turns, campaign after campaign: those that are searched for, those in no catalogue"""


def lacking(without: str, number: int) -> str:
    """The effect that campaign `number` (from 1) hides and the catalogue lacks by `--without`; empty for none."""
    turns = TURNS.get(without, (without,))
    return turns[(number - 1) % len(turns)]


def case_with(id: str, seed: int, number: int, mass: float, cables: int) -> Case:
    """Campaign `number` with this effect alone, for a catalogue that lacks it."""
    rng = np.random.default_rng([seed, number, 13])
    return Case(SecretKind.ONE, (_sized(id, rng, mass, cables),))


def _dealt(seed: int, number: int, only: SecretKind | None) -> tuple[SecretKind, tuple[str, ...]]:
    """The kind and ids of one campaign, from the deck in which it lies: every id comes equally often."""
    block, place = divmod(number - 1, sum(DECK.values()))
    rng = np.random.default_rng([seed, block, 11])
    kinds = [kind for kind, count in DECK.items() for _ in range(count)]
    kinds = [only or kinds[k] for k in rng.permutation(len(kinds))]
    effects, outside = _Pile(EFFECTS, rng), _Pile(OUTSIDE, rng)
    ids: tuple[str, ...] = ()
    for kind in kinds[: place + 1]:
        ids = _ids(kind, effects, outside)
    return kinds[place], ids


def _ids(kind: SecretKind, effects: "_Pile", outside: "_Pile") -> tuple[str, ...]:
    match kind:
        case SecretKind.NOTHING:
            return ()
        case SecretKind.OUTSIDE:
            return (outside.take(()),)
        case SecretKind.FAULT:
            return ("sensor-fault",)
        case SecretKind.ONE | SecretKind.TWO | SecretKind.THREE:
            taken: tuple[str, ...] = ()
            for _ in range({SecretKind.ONE: 1, SecretKind.TWO: 2, SecretKind.THREE: 3}[kind]):
                taken = (*taken, effects.take(taken))
            return taken


class _Pile:
    """Ids in random order, shuffled anew when all were taken."""

    def __init__(self, sizes: Mapping[str, Size], rng: Rng) -> None:
        self._all, self._rng = tuple(sizes), rng
        self._left: list[str] = []

    def take(self, beside: tuple[str, ...]) -> str:
        """The next that may stand beside these."""
        while True:
            for id in self._left:
                if id not in beside and not any({id, other} in NOT_TOGETHER for other in beside):
                    self._left.remove(id)
                    return id
            self._left += [self._all[k] for k in self._rng.permutation(len(self._all))]


def _sized(id: str, rng: Rng, mass: float, cables: int) -> Hidden:
    spec = SIZES[id]
    size = float(np.exp(rng.uniform(np.log(spec.low), np.log(spec.high))))
    size *= mass / 11.0 if spec.with_mass else 1.0
    keys = {key: float(value) for key, value in spec.keys(rng, size).items()}
    if spec.one_cable:
        keys["cable"] = float(rng.integers(1, cables + 1))
    return Hidden(id, size, spec.unit, keys)
