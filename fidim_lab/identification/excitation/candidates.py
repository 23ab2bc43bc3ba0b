"""Chains of strokes by linear theory: for each mode one near its frequency, with turns and direction.

With the turns given, the swing that remains, the tensions on the way and what the winches do are all linear in the
chains' directions. So the directions that swing the platform farthest within all limits are the solution of a linear
program; the numbers of turns are tried out.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Complex, Float
from scipy import optimize

from fidim_lab.errors import OurBugError
from fidim_lab.identification.excitation.place import ExcitationPlace, WinchLimits
from fidim_lab.identification.excitation.strokes import Chain, Pattern
from fidim_lab.model.swing import Swing

SPARE = 0.9
"""part of the winches' speed and acceleration that a plan uses: a second try may want more"""
GAP = 0.15
"""s between two chains: the drives are told their next speeds"""
DUTY = 0.9
TURNS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16)
FEWER = (1, 3, 6, 12)
"""where three modes are wanted: all choices are looked at"""
SOONER = (1.0, 0.7, 0.5)
"""parts of the time that the best choice takes, in which others are looked for"""
NEARLY = 0.95
SEEN = 0.08
"""part of the whole swing under which a mode is left alone"""
AMPLE = 2.0
"""times the wanted swing: what could reach so much pulls gently enough when it is made smaller"""
SIZE = 0.01
"""m: the unit of directions in the program, so that all its numbers are near 1"""
FINE = 16
"""looks at tensions in each period of the fastest mode"""
AFTERWARDS = 2.0
"""periods of the slowest mode, in which the free motion is looked at too"""
CLOSED = 0.01
"""part of what a tension may change, by which a solution may be off"""
ROUNDS = 20
TINY = 1e-9


@dataclass(frozen=True, eq=False)
class Hanging:
    """A body that may hang there, and what it may pull."""

    swing: Swing
    """with the least damping there may be"""
    room: Float[np.ndarray, "2 n"]
    """N/kg: by how much tensions may fall below those at rest, and rise above them"""


@dataclass(frozen=True, eq=False)
class ChainCandidate:
    """Chains by linear theory."""

    share: float
    """the part of the wanted swing that they reach"""
    chains: tuple[Chain, ...]
    modes: tuple[int, ...]
    """of each chain"""
    by_winches: float
    """the part that the winches reach where no tension is looked at"""

    @property
    def seconds(self) -> float:
        """From the first stroke's begin to the last one's end."""
        return begins_of(self.chains)[-1] + self.chains[-1].pattern.seconds


def candidates(
    place: ExcitationPlace,
    wanted: Float[np.ndarray, " modes"],
    ratio: Float[np.ndarray, " modes"],
    gain: Float[np.ndarray, " modes"],
    limits: WinchLimits,
    hanging: Sequence[Hanging],
) -> list[ChainCandidate]:
    """The chains that bring the platform nearest to the wanted swing (m) within all limits; after them quicker ones.

    ratio: of true frequencies to the model's. gain: by how much farther than the model each mode's chain may swing the
    platform. hanging: the likely body first. Of all numbers of turns, those that reach most; of those that reach nearly
    as much, the shortest. Quicker ones reach less here, but may reach more by the nonlinear model: a chain of many
    turns falls out of step with a swing that gets large.
    """
    modes = tuple(int(j) for j in np.flatnonzero(wanted > SEEN * np.linalg.norm(wanted)))
    programs = _programs(place, wanted, ratio, gain, limits, modes)
    by_winches = min(1.0, max(float(program.solution(())[-1]) for program in programs))
    # with more bodies less is reached, never more: who is behind with the likely one need not be looked at with all
    bounds = [(float(program.solution(hanging[:1])[-1]), program) for program in programs]
    solved: dict[_Program, np.ndarray] = {}
    found: list[ChainCandidate] = []
    for part in SOONER:
        time = part * found[0].seconds if found else np.inf
        quick = [one for one in bounds if one[1].seconds <= time]
        if not quick:
            break
        x, program = _best(quick, hanging, solved)
        share = min(1.0, float(x[-1]))
        found.append(ChainCandidate(share, program.chains(x * share / max(float(x[-1]), TINY)), modes, by_winches))
    return found


def _best(
    bounds: "list[tuple[float, _Program]]", hanging: Sequence[Hanging], solved: "dict[_Program, np.ndarray]"
) -> "tuple[np.ndarray, _Program]":
    """The program that reaches most with all bodies, or the shortest of those that reach nearly as much.

    bounds: what each may reach at most. solved: solutions that are known, and are added to.
    """
    found: list[tuple[np.ndarray, _Program]] = []
    for bound, program in sorted(bounds, key=_most_first):
        if found and max(x[-1] for x, _ in found) >= NEARLY * bound:
            break
        if program not in solved:
            solved[program] = program.solution(hanging)
        found.append((solved[program], program))
    most = max(x[-1] for x, _ in found)
    return min((one for one in found if one[0][-1] >= NEARLY * most), key=lambda one: one[1].seconds)


def begins_of(chains: Sequence[Chain]) -> tuple[float, ...]:
    """When each chain begins, s since the first does."""
    return _begins([chain.pattern for chain in chains])


def half_periods(swing: Swing) -> Float[np.ndarray, " modes"]:
    """s, damped."""
    return 0.5 / (swing.frequencies * np.sqrt(1 - swing.damping**2))


def _begins(patterns: Sequence[Pattern]) -> tuple[float, ...]:
    begins = [0.0]
    for pattern in patterns[:-1]:
        begins.append(begins[-1] + pattern.seconds + GAP)
    return tuple(begins)


def _most_first(one: tuple[float, "_Program"]) -> tuple[float, float]:
    return -round(one[0], 3), one[1].seconds


def _programs(
    place: ExcitationPlace,
    wanted: Float[np.ndarray, " modes"],
    ratio: Float[np.ndarray, " modes"],
    gain: Float[np.ndarray, " modes"],
    limits: WinchLimits,
    modes: tuple[int, ...],
) -> "list[_Program]":
    """One for each choice of turns for which there is time; the quickest of all in any case."""
    swing = place.swing
    halves = half_periods(swing)
    made: list[_Program] = []
    for turns in itertools.product(TURNS if len(modes) <= 2 else FEWER, repeat=len(modes)):
        patterns = tuple(Pattern(float(halves[j]), count, DUTY) for j, count in zip(modes, turns, strict=True))
        program = _Program(place, patterns, modes, wanted, ratio, gain, limits)
        if not made or program.seconds <= limits.seconds:
            made.append(program)
    return made


@dataclass(frozen=True, eq=False)
class _Program:
    """Unknown are the chains' directions (in `SIZE`), one after the other, and last the share of the wanted swing."""

    place: ExcitationPlace
    patterns: tuple[Pattern, ...]
    modes: tuple[int, ...]
    wanted: Float[np.ndarray, " modes"]
    ratio: Float[np.ndarray, " modes"]
    gain: Float[np.ndarray, " modes"]
    limits: WinchLimits

    @cached_property
    def begins(self) -> tuple[float, ...]:
        """s"""
        return _begins(self.patterns)

    @cached_property
    def seconds(self) -> float:
        """From the first stroke's begin to the last one's end."""
        return self.begins[-1] + self.patterns[-1].seconds

    def chains(self, x: Float[np.ndarray, " x"]) -> tuple[Chain, ...]:
        """Of a solution."""
        directions = SIZE * x[:-1].reshape(len(self.patterns), -1)
        return tuple(Chain(pattern, direction) for pattern, direction in zip(self.patterns, directions, strict=True))

    def solution(self, hanging: Sequence[Hanging]) -> Float[np.ndarray, " x"]:
        """The largest share.

        Few of all the tensions come near their limits: those that a solution breaks are added until it breaks none.
        """
        pulls = [self._pulls(one) for one in hanging]
        chosen = np.vstack([self._aside(), *(self._at_rest(one) for one in hanging[:1])])
        bounds = [*np.concatenate([self._most(k) for k in range(len(self.patterns))]), AMPLE]
        x = self._optimum(chosen, np.array(bounds))
        for _ in range(ROUNDS):
            broken: list[np.ndarray] = []
            for rows in pulls:
                used = rows @ x
                worst = used.argmax(axis=1)
                over = np.take_along_axis(used, worst[:, np.newaxis], axis=1)[:, 0] > 1 + CLOSED
                broken.extend(rows[over, worst[over]])
            if not broken:
                return x
            chosen = np.vstack([chosen, np.pad(broken, ((0, 0), (0, 1)), constant_values=1.0)])
            x = self._optimum(chosen, np.array(bounds))
        return x

    def _optimum(self, rows: Float[np.ndarray, "K x+1"], most: Float[np.ndarray, " x"]) -> Float[np.ndarray, " x"]:
        """Rows are what is to be at most the number that is last in each."""
        aim = np.zeros(len(most))
        aim[-1] = -1.0
        swings = self._wanted_swings
        equal = np.vstack([np.real(swings), np.imag(swings)])
        equal[: len(self.modes), -1] = -self.wanted[list(self.modes)] / SIZE
        bounds = [*((-float(one), float(one)) for one in most[:-1]), (0.0, float(most[-1]))]
        found = optimize.linprog(
            aim, rows[:, :-1], rows[:, -1], equal, np.zeros(len(equal)), bounds=bounds, method="highs"
        )
        if found.x is None:
            raise OurBugError(f"Excitation: the linear program of its strokes ended with {found.message}")
        return found.x

    @cached_property
    def _wanted_swings(self) -> Complex[np.ndarray, "some x"]:
        return self._swings(self.modes)

    def _swings(self, modes: Sequence[int]) -> Complex[np.ndarray, "some x"]:
        """How the marker swings in these modes at the end (`SIZE`), each in the phase that its own chain gives it."""
        swing, found = self.place.swing, []
        for pattern, begin in zip(self.patterns, self.begins, strict=True):
            fading = np.exp(swing.rates * (self.seconds - begin - pattern.seconds))
            found.append(pattern.response(swing.rates) * swing.dragged * fading)
        by_chain = np.array(found).T * (swing.lever / np.abs(np.imag(swing.rates)))[:, np.newaxis]
        rows: list[np.ndarray] = []
        for j in modes:
            own = by_chain[j, self.modes.index(j)] if j in self.modes else 1.0
            rows.append(np.append(np.outer(by_chain[j] / (own / np.abs(own)), swing.gain[j]).ravel(), 0.0))
        return np.array(rows).reshape(len(modes), -1)

    def _aside(self) -> Float[np.ndarray, "K x+1"]:
        """Modes that are not wanted swing little."""
        others = [j for j in range(len(self.wanted)) if j not in self.modes]
        width = len(self.modes) * len(self.place.equilibrium.lengths) + 1
        if not others:
            return np.zeros((0, width + 1))
        swings = self._swings(others)
        rows = np.vstack([np.real(swings), -np.real(swings), np.imag(swings), -np.imag(swings)])
        rows[:, -1] = -SEEN * float(np.linalg.norm(self.wanted)) / SIZE
        return np.pad(rows, ((0, 0), (0, 1)))

    def _most(self, k: int) -> Float[np.ndarray, " n"]:
        """What the winches may do in a chain, of each cable (`SIZE`)."""
        pattern, ratio, limits = self.patterns[k], float(self.ratio[self.modes[k]]), self.limits
        allowed = min(limits.speed / (pattern.speed * ratio), limits.acceleration / (pattern.acceleration * ratio**2))
        return SPARE / SIZE * np.minimum(limits.ways(self.place.equilibrium.lengths), allowed)

    def _at_rest(self, one: Hanging) -> Float[np.ndarray, "K x+1"]:
        """Tensions at rest at the strokes' ends, on both sides: an emergency stop may leave the platform there."""
        there = SIZE * one.swing.pull.by_lengths / one.room.min(axis=0)[:, np.newaxis]
        each = np.vstack([there, -there])
        rows = np.kron(np.eye(len(self.patterns)), each)
        return np.column_stack([rows, np.zeros(len(rows)), np.ones(len(rows))])

    def _pulls(self, one: Hanging) -> Float[np.ndarray, "2n N x"]:
        """Parts of what tensions may fall and rise, on the way and in the free motion after it."""
        swing = one.swing
        slow, fast = swing.frequencies[[0, -1]]
        t = np.arange(0.0, self.seconds + AFTERWARDS / slow, 1 / (FINE * fast))
        found: list[np.ndarray] = []
        for pattern, begin, mode in zip(self.patterns, self.begins, self.modes, strict=True):
            q = np.imag(pattern.responses(swing.rates, t - begin)) / np.imag(swing.rates)[:, np.newaxis]
            offset, acceleration = pattern.motion(t - begin)
            pull = swing.pull
            tensions = (
                -np.einsum("cj,jt,ji->cti", pull.by_swing, q, swing.gain)
                + offset[:, np.newaxis] * pull.by_lengths[:, np.newaxis, :]
                + acceleration[:, np.newaxis] * pull.by_acceleration[:, np.newaxis, :]
            )
            found.append(SIZE * max(float(self.gain[mode]), 1.0) * tensions)
        rows = np.concatenate([*found, np.zeros((*found[0].shape[:2], 1))], axis=2)
        down, up = one.room[:, :, np.newaxis, np.newaxis]
        return np.concatenate([-rows / down, rows / up])
