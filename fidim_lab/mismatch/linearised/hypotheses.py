"""All hypotheses: every effect of the catalogue that can be scored, and a list of those that cannot.

A hypothesis is one effect at one scan point (a creep's time constant, a fan's frequency): within it only parameters
that have a score are free. Periodic effects are not asked for their own expressions at sixty frequencies: a steady
force's influence, modulated by sin and cos, is the same thing (`columns`).
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field

import numpy as np

from fidim_lab.data.files.toml_file import nearest
from fidim_lab.data.records import Robot
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot
from fidim_lab.effects.catalogue import catalogue
from fidim_lab.effects.dissipation.pulley_friction import SwivelFrictionGivingWay
from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.effects.loads.loose_mass import LooseMass
from fidim_lab.errors import SetupError
from fidim_lab.mismatch.thresholds import SHARED

MOST_SCANNED = 20
"""scan points of one effect"""

NOT_BY_SCORE = ("hand-contact", "sensor-fault", "unknown", "time-offset")
"""found by other means: screening, what is left at the end, motor currents"""
PERIODIC = ("periodic-force", "frame-sway")
RIDING = (LooseMass, SwivelFrictionGivingWay)
"""effects whose own states follow from the platform's motion alone where their amplitude is 0 (`resonance`,
`giving_way`)"""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """One effect at one scan point."""

    effect: NamedEffect
    absent: np.ndarray
    """θ at which it does nothing; scanned parameters at the values tried"""
    scored: tuple[int, ...]
    """which of its parameters are free"""
    prior_sd: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """of the scored ones, before any data"""
    alike: int = 1
    """how many differ from it in the cable alone, itself counted"""

    @property
    def label(self) -> str:
        """For people."""
        return self.effect.label

    @property
    def has_scan(self) -> bool:
        """Whether it is scored at some values of a parameter only: the best of them may be far from the truth.

        Not tones: they are scanned finely.
        """
        return self.effect.id not in PERIODIC and any(len(one.scan) > 1 for one in self.effect.parameters)

    @property
    def choice(self) -> float:
        """Nats that having chosen its cable costs: on all of them alike nothing was chosen."""
        return float(np.log(self.alike))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The scored ones."""
        return tuple(self.effect.parameters[k] for k in self.scored)

    def theta(self, scored: np.ndarray) -> np.ndarray:
        """The full θ from the scored parameters."""
        values = self.absent.copy()
        values[list(self.scored)] = scored
        return values


@dataclass(frozen=True, eq=False)
class Hypotheses:
    """All hypotheses for one robot."""

    direct: tuple[Hypothesis, ...]
    """scored by their own slots"""
    periodic: tuple[Hypothesis, ...]
    """scored by modulation: one for each frequency and kind"""
    untested: tuple[str, ...]
    """ids of the catalogue that this version cannot score"""
    without: frozenset[str] = frozenset()
    """ids of effects that are taken as unknown, in whatever form"""

    def admitted(self, forms: Iterable[tuple[NamedEffect, np.ndarray]]) -> tuple[tuple[NamedEffect, np.ndarray], ...]:
        """Those forms of a term, with their θ, that are not taken as unknown."""
        return tuple(form for form in forms if form[0].id not in self.without)

    @property
    def every(self) -> tuple[Hypothesis, ...]:
        """Direct ones first."""
        return self.direct + self.periodic

    @property
    def slices(self) -> tuple[slice, ...]:
        """Which scored parameters, in a row of all, belong to each of `every`."""
        ends = np.cumsum([len(h.scored) for h in self.every])
        return tuple(slice(int(end) - len(h.scored), int(end)) for h, end in zip(self.every, ends, strict=True))


def hypotheses(robot: Robot, without: Collection[str] = ()) -> Hypotheses:
    """Every hypothesis that can be scored for this robot, in the catalogue's order; without effects of these ids."""
    direct: list[Hypothesis] = []
    periodic: list[Hypothesis] = []
    seen: set[str] = set()
    effects = [effect for effect in catalogue(robot) if effect.id not in {*NOT_BY_SCORE, *without}]
    for effect in effects:
        alike = 1 if effect.cable is None else len(robot.cables)
        if effect.id in PERIODIC and not effect.of_each_window:
            periodic.extend(_at_scan_points(effect, alike))
        elif _can_be_scored(effect):
            direct.extend(_at_scan_points(effect, alike))
        else:
            continue
        seen.add(effect.id)
    untested = dict.fromkeys(effect.id for effect in effects if effect.id not in seen)
    return Hypotheses(tuple(direct), tuple(periodic), tuple(untested), frozenset(without))


def general(simple: Hypothesis, effect: NamedEffect, start: np.ndarray) -> Hypothesis:
    """A more general form of a hypothesis that was found, at what it starts from: only its amplitudes may be absent."""
    scored = tuple(k for k, scanned in enumerate(effect.scanned) if not scanned)
    absent = start.copy()
    absent[list(scored)] = 0.0
    prior = np.array([SHARED.wide * effect.parameters[k].scale for k in scored])
    return Hypothesis(effect, absent, scored, prior, simple.alike)


def rides(tried: Hypothesis) -> bool:
    """Whether its own states follow from the platform's motion alone."""
    return isinstance(tried.effect, RIDING)


def _can_be_scored(effect: NamedEffect) -> bool:
    """A hose with a rest length has too many scan points; states of their own are known for what merely rides along."""
    known = not effect.extra_states or isinstance(effect, RIDING)
    return known and effect.id not in PERIODIC and len(effect.scan_points) <= MOST_SCANNED


def _at_scan_points(effect: NamedEffect, alike: int) -> Iterable[Hypothesis]:
    scored = tuple(k for k, scanned in enumerate(effect.scanned) if not scanned)
    prior = np.array([SHARED.wide * effect.parameters[k].scale for k in scored])
    return [Hypothesis(effect, point, scored, prior, alike) for point in effect.scan_points]


def check_known(effects: Collection[str]) -> None:
    """Raises SetupError for what no search tries, naming what it does try."""
    if not effects:
        return
    known = {effect.id for effect in catalogue(read_robot(PAPERS_ROBOT))} - {*NOT_BY_SCORE}
    for effect in effects:
        if effect not in known:
            near = nearest(effect, known)
            meant = f"Did you mean {near}? " if near else ""
            there = f"There are: {', '.join(sorted(known))}."
            raise SetupError(f"without {effect}: no such effect.", hint=meant + there)
