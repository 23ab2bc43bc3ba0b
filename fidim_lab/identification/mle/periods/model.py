"""What a stopwatch and a level would say of many bodies at once, with derivatives, and which mode each period is of.

A period that bears a name is that of the mode with the largest share of such motion, and where several modes have it,
of the one that is nearest; without a name nearness alone decides. Each mode is taken once.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations

import numpy as np
from jaxtyping import Bool, Float, Int

from fidim_lab.data.records import Body, Period
from fidim_lab.errors import InfeasibleError, SetupError
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.many_swings import MOTIONS, ManyRests, ManySwings, many_swings, tilts
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY

DIFFERENCE = 1e-4
"""m, m and rad: for derivatives by the centre of mass, the geometry and the cords; far above the digits of a rest"""
PENDULUM = 1 / 16
"""of the square of an amplitude (rad), by which a pendulum's swing takes longer"""
UNNOTED = 0.1
"""rad: an amplitude that nobody noted, as a push by hand makes it"""
ALIKE = 0.01
"""of a period: periods of one hanging and one name, or none, that are so near are of one swing"""
NEARNESS, FAR, LEAST = 2.0, 0.5, 10.0
"""share of a motion that a period e times as long is worth, at most, and without a name: names decide, but where modes
do two motions nearly alike"""

RIVAL = 0.5
"""of a mode's share of a motion, from which another one may have been meant"""

NONE = 0.05
"""of a mode's motion: where every mode has less of one, nobody sees it"""
FAR_OFF = 1.6
"""times the nominal body's period, or its part: an inertia 2.6 times as large; counting halves makes it 2"""


@dataclass(frozen=True, eq=False)
class Said:
    """What M readings would be of B bodies: ln of the periods (s), then the tilts (rad)."""

    readings: Float[np.ndarray, "B M"]
    slopes: Float[np.ndarray, "B M 9"]
    """by the nine parameters"""
    hangs: Bool[np.ndarray, " B"]
    """whether the body hangs at all lengths"""
    rests: tuple[ManyRests, ...]
    """at each of them"""

    def of(self, rows: np.ndarray) -> "Said":
        """Of some of the bodies."""
        return Said(
            self.readings[rows], self.slopes[rows], self.hangs[rows], tuple(rest.of(rows) for rest in self.rests)
        )

    def put(self, rows: np.ndarray, other: "Said") -> None:
        """Let these rows be those of another."""
        self.readings[rows], self.slopes[rows], self.hangs[rows] = other.readings, other.slopes, other.hangs
        for mine, their in zip(self.rests, other.rests, strict=True):
            mine.put(rows, their)


@dataclass(frozen=True, eq=False)
class PeriodModel:
    """Readings of one pendulum and what they depend on."""

    mechanism: Mechanism
    """with its geometry open"""
    nominal: Body
    periods: tuple[Period, ...]
    hangings: tuple[np.ndarray, ...]
    """lengths by tape, each different set once"""
    usual: tuple[ManyRests, ...]
    """of the nominal body there"""

    @staticmethod
    def of(mechanism: Mechanism, body: Body, periods: Sequence[Period]) -> "PeriodModel":
        """Raises SetupError for lengths at which the body cannot hang, and for more swings there than it has."""
        hangings: list[np.ndarray] = []
        rests: list[ManyRests] = []
        for k, period in enumerate(periods, start=1):
            if any(np.array_equal(period.lengths, known) for known in hangings):
                continue
            try:
                rests.append(ManyRests.all_at(pose_from_lengths(mechanism, body, period.lengths), 1))
            except InfeasibleError as error:
                raise SetupError(
                    f"Period {k}, lengths: {error.message}",
                    hint="Lengths are by tape, from anchor to attachment, m; compare d and a of the robot file.",
                ) from error
            hangings.append(period.lengths)
        made = PeriodModel(mechanism, body, tuple(periods), tuple(hangings), tuple(rests))
        for h in range(len(hangings)):
            made.refuse_more_than_free(h)
        return made

    def refuse_more_than_free(self, h: int) -> None:
        """Raise SetupError where so many different periods were read at a hanging that no swing is left for some."""
        rows = [k for k in range(len(self.periods)) if self.hanging[k] == h]
        groups, free = _groups([self.periods[k] for k in rows]), self.mechanism.robot.freedoms
        count = len(set(groups))
        if count > free:
            told = ", ".join(f"{self.periods[k].value:.4g} s ({self.periods[k].name})" for k in rows)
            raise SetupError(
                f"Periods {', '.join(str(k + 1) for k in rows)}: {count} different ones, {told}, were read at the "
                f"same lengths, and the body has {free} swings there.",
                hint=f"Readings of one swing agree to {100 * ALIKE:g} %: leave out those that were miscounted.",
            )

    @cached_property
    def hanging(self) -> tuple[int, ...]:
        """Of each period the number of its hanging."""
        return tuple(
            next(h for h, one in enumerate(self.hangings) if np.array_equal(one, period.lengths))
            for period in self.periods
        )

    @cached_property
    def levels(self) -> dict[int, tuple[float, float, float]]:
        """Tilts that were read, by hanging: the mean of what its rows say, with their largest standard deviation."""
        found: dict[int, list[tuple[float, float, float]]] = {}
        for k, period in enumerate(self.periods):
            if period.tilt is not None:
                found.setdefault(self.hanging[k], []).append(period.tilt)
        means = {h: np.mean(values, axis=0) for h, values in found.items()}
        return {h: (float(x), float(y), max(one[2] for one in found[h])) for h, (x, y, _) in sorted(means.items())}

    @property
    def measured(self) -> tuple[Float[np.ndarray, " M"], Float[np.ndarray, " M"]]:
        """Readings as they would be of small swings, and their standard deviations."""
        longer = PENDULUM * np.array([UNNOTED if p.amplitude is None else p.amplitude for p in self.periods]) ** 2
        values = np.array([p.value for p in self.periods])
        sd = np.array([p.sd / p.swings for p in self.periods]) / values
        levels = self.levels.values()
        read = [value for x, y, _ in levels for value in (x, y)]
        noise = [one for _, _, one in levels for _ in range(2)]
        return (
            np.concatenate([np.log(values) - np.log1p(longer), read]),
            np.concatenate([np.hypot(sd, longer), noise]),
        )

    def start(self, many: int) -> tuple[ManyRests, ...]:
        """The nominal body's rests, so many of each."""
        return tuple(rest.of(np.zeros(many, dtype=int)) for rest in self.usual)

    def said(self, bodies: Float[np.ndarray, "B 9"], near: Sequence[ManyRests]) -> Said:
        """Readings of bodies whose inertia lets them move, and their derivatives."""
        many, robot = len(bodies), self.mechanism.robot
        readings = np.zeros((many, len(self.periods) + 2 * len(self.levels)))
        slopes = np.zeros((*readings.shape, BODY))
        steps = DIFFERENCE * np.eye(BODY)[[0, 0, 1, 2]]
        steps[0] = 0.0
        moved = np.tile((bodies + steps[:, np.newaxis]).reshape(-1, BODY), (len(self.hangings), 1))
        lengths = np.repeat(np.array(self.hangings), 4 * many, axis=0)
        begin = ManyRests.joined([one for one in near for _ in range(4)])
        swings = many_swings(self.mechanism, moved, lengths, begin)
        at = np.arange(many)[:, np.newaxis]
        rests: list[ManyRests] = []
        for h in range(len(self.hangings)):
            here = swings.of(slice(4 * h * many, 4 * (h + 1) * many))
            rows, modes = self.modes(h, here)
            read = np.take_along_axis(here.log_periods, modes, 1)
            slopes[:, rows, 3:] = here.of(slice(0, many)).slopes[at, modes[:many]]
            if h in self.levels:
                rows = np.concatenate([rows, self.level_rows(h)])
                read = np.hstack([read, tilts(robot, here.rests)])
            read = read.reshape(4, many, len(rows))
            readings[:, rows] = read[0]
            slopes[:, rows, :3] = np.moveaxis((read[1:] - read[0]) / DIFFERENCE, 0, 2)
            rests.append(here.of(slice(0, many)).rests)
        hangs = np.all(swings.hangs.reshape(-1, many), axis=0) & np.all(np.isfinite(readings), axis=1)
        return Said(readings, slopes, np.asarray(hangs), tuple(rests))

    def level_rows(self, h: int) -> Int[np.ndarray, "2"]:
        """Which readings are the tilts of a hanging that has them."""
        return len(self.periods) + 2 * list(self.levels).index(h) + np.arange(2)

    def modes(self, h: int, swings: ManySwings) -> tuple[Int[np.ndarray, " N"], Int[np.ndarray, "B N"]]:
        """Which periods belong to a hanging, and of each body the mode that each of them is of."""
        rows = [k for k in range(len(self.periods)) if self.hanging[k] == h]
        groups = _groups([self.periods[k] for k in rows])
        free = swings.squares.shape[1]
        costs: list[np.ndarray] = []
        for group in dict.fromkeys(groups):
            one = self.periods[rows[groups.index(group)]]
            off = NEARNESS * np.abs(swings.log_periods - np.log(one.value))
            if one.motion:
                share = swings.shares[:, list(MOTIONS).index(one.motion)]
                cost = np.minimum(off, FAR) + np.where(swings.squares > 0, 1 - share, 1.0)
            else:
                cost = np.minimum(off, LEAST)
            costs.append(cost)
        ways = np.array(list(permutations(range(free), len(costs))))
        total = sum(cost[:, ways[:, g]] for g, cost in enumerate(costs))
        best = ways[np.argmin(total, axis=1)]
        order = list(dict.fromkeys(groups))
        return np.array(rows), best[:, [order.index(group) for group in groups]]

    def far_off(self) -> tuple[int, str, str] | None:
        """The first period that no body like the nominal one has: its index, what is wrong, and what to do."""
        for h, rests in enumerate(self.usual):
            swings = many_swings(self.mechanism, self.nominal.vector[np.newaxis], self.hangings[h][np.newaxis], rests)
            rows, modes = self.modes(h, swings)
            usual = np.exp(swings.log_periods[0])
            known = [
                f"{usual[mode]:.3g} s ({list(MOTIONS)[int(np.argmax(swings.shares[0, :, mode]))]})"
                for mode in range(len(usual))
                if np.isfinite(usual[mode])
            ]
            hint = f"By the robot file its swings take {', '.join(known)}."
            for k, mode in zip(rows.tolist(), modes[0].tolist(), strict=True):
                one = self.periods[k]
                if one.motion and swings.shares[0, list(MOTIONS).index(one.motion)].max() < NONE:
                    what = f"no swing at these lengths is {one.motion} ({MOTIONS[one.motion]})"
                    return k, what, f"{hint} Leave the motion blank where it is uncertain."
                ratio = one.value / usual[mode]
                if not 1 / FAR_OFF < ratio < FAR_OFF:
                    what = f"a swing ({one.name}) takes {one.value:.4g} s, {ratio:.3g} times that of the nominal body"
                    return k, what, f"{_guess(ratio)}{hint}"
        return None

    def vague(self, x: Float[np.ndarray, "9"], near: Sequence[ManyRests]) -> tuple[int, ...]:
        """Periods of which another mode of this body, with another period, has nearly as much of the named motion."""
        found: list[int] = []
        for h, lengths in enumerate(self.hangings):
            swings = many_swings(self.mechanism, x[np.newaxis], lengths[np.newaxis], near[h])
            rows, modes = self.modes(h, swings)
            for k, mode in zip(rows, modes[0], strict=True):
                if self.periods[k].motion:
                    share = swings.shares[0, list(MOTIONS).index(self.periods[k].motion)]
                    apart = np.abs(swings.log_periods[0] - swings.log_periods[0, mode]) > ALIKE
                    found += [int(k)] if (apart & (share > RIVAL * share[mode])).any() else []
        return tuple(found)

    def by_geometry(self, x: Float[np.ndarray, "9"], near: Sequence[ManyRests]) -> Float[np.ndarray, "M theta+cords"]:
        """Derivatives of one body's readings by the open geometry, then by the cords of each hanging."""
        size, n = len(self.mechanism.theta), self.mechanism.n
        found = np.zeros((len(self.periods) + 2 * len(self.levels), size + n * len(self.hangings)))
        for h, lengths in enumerate(self.hangings):
            step = np.vstack([np.zeros(size + n), DIFFERENCE * np.eye(size + n)])
            many = len(step)
            swings = many_swings(
                self.mechanism,
                np.tile(x, (many, 1)),
                lengths + step[:, size:],
                near[h].of(np.zeros(many, dtype=int)),
                self.mechanism.theta + step[:, :size],
            )
            rows, modes = self.modes(h, swings)
            read = np.take_along_axis(swings.log_periods, modes, 1)
            if h in self.levels:
                rows = np.concatenate([rows, self.level_rows(h)])
                read = np.hstack([read, tilts(self.mechanism.robot, swings.rests)])
            columns = np.concatenate([np.arange(size), size + n * h + np.arange(n)])
            found[np.ix_(rows, columns)] = ((read[1:] - read[0]) / DIFFERENCE).T
        return found


def _guess(ratio: float) -> str:
    for factor, why in (
        (0.5, "Were passages one way and back counted as two swings? "),
        (2.0, "Was every second swing counted? "),
        (1000.0, "Times are in s, not in ms. "),
        (1 / 60, "Times are in s, not in minutes. "),
    ):
        if 1 / FAR_OFF < ratio / factor < FAR_OFF:
            return why
    return "Compare motion, lengths, count and the nominal body. "


def _groups(periods: Sequence[Period]) -> list[str]:
    """Of each period of one hanging, which swing it is of: periods of one name that are alike are of one."""
    groups = [period.motion for period in periods]
    last: dict[str, float] = {}
    for k in sorted(range(len(periods)), key=lambda k: periods[k].value):
        name, value = periods[k].motion, periods[k].value
        if value > (1 + ALIKE) * last.get(name, 0.0):
            last[name] = value
        groups[k] = f"{name} {last[name]:.9g}"
    return groups
