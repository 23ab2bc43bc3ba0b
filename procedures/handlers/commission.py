"""Handler of the trials of stops: a winch moves, is made to stop, and its encoder shows what it did.

The encoder is asked outside the bus cycle (`Winch.ask_length`): what is withheld may be the cycle itself. Whatever ends
a trial, the winch is quick-stopped and loses its power; without load its brake, or nothing, has to hold it then.
"""

from dataclasses import dataclass, field

from drivers.ports import DriveState, Trial, TrialBench, TrialStop, Winch
from fidim_lab.errors import DeviceError, OurBugError
from procedures.outcomes import Measurement, Outcome, judge
from procedures.stand import Stand
from procedures.steps import Result
from procedures.steps.commission import RUNS_ON, ProveStop
from procedures.timing import POLL, wait_until

STAYS_ENABLED = (Trial.HALT, Trial.POSITION_LIMIT)
"""trials after which a drive may go on holding as before; after the others it must be enabled anew"""
UNCOMMANDED = (Trial.LOST_HEARTBEAT, Trial.LOST_SYNC)
"""trials in which nobody tells the drive to stop: one that is in fault afterwards was stopped by its fault reaction"""
SETTLED = 0.15
"""s without motion after which a winch stands: ten looks and more, so that a slow ramp is not taken for its end"""
AHEAD = 0.02
"""s of motion at full speed before anything is provoked"""
BEYOND = 1.5
"""times the allowed time, and `SLACK` s: so long a stop is waited for"""
SLACK = 0.3
BEGINS = 1.0
"""s more than its ramp takes, in which a winch must be seen to move"""
PATIENCE = 0.5
"""s for each stronger means of stopping"""


class _WrongError(Exception):
    """Control flow: what the winch did instead."""


@dataclass
class _Way:
    """What the encoder told: s of the clock, and m gone in the direction of the move."""

    winch: Winch
    stand: Stand
    start: float
    sign: int
    still: float
    """m; less is no motion"""
    seen: list[tuple[float, float]] = field(default_factory=list[tuple[float, float]])

    async def look(self) -> float:
        """m gone by now."""
        gone = self.sign * (await self.winch.ask_length() - self.start)
        self.seen.append((self.stand.rig.clock.now(), gone))
        await self.stand.rig.clock.sleep(POLL)
        return gone

    def moved_last(self) -> tuple[float, float]:
        """Time and place of the last motion seen: the first sample after which nothing changed."""
        when, place = self.seen[-1]
        for t, gone in reversed(self.seen):
            if abs(gone - place) > self.still:
                break
            when = t
        return when, place

    def stands(self) -> bool:
        """Whether nothing has moved for a while."""
        return self.seen[-1][0] - self.moved_last()[0] >= SETTLED


async def prove_stop(stand: Stand, step: ProveStop) -> Result:
    """One trial, whatever comes of it; the winch has no power afterwards."""
    winch, bench = stand.rig.winches[step.winch], _bench(stand, step.winch)
    if lack := bench.lacks(step.trial):
        return Result(Outcome.SKIPPED, lack)
    found: list[Measurement] = []
    wrong, powered = list[str](), True
    runs_on = faulted = False
    try:
        try:
            found += await _stopped(stand, step, winch, bench)
        except _WrongError as error:
            wrong.append(str(error))
        bench.end()
        if wrong:
            runs_on = (obeyed := await _made_to_stop(stand, winch)) != ""
            wrong.append(obeyed)
        else:
            says, faulted = await _stays(stand, step, winch, found)
            wrong.append(says)
        winch.power_off()
        powered = False
    finally:
        bench.leave()
        if powered:  # an error or a person's word: only what never waits
            winch.quick_stop()
    wrong.append(await _without_power(stand, step, winch, found))
    values = tuple(m.value or 0.0 for m in found[:2])
    readings = {"identity": tuple(float(number) for number in await bench.identity())}
    if faulted and step.trial in UNCOMMANDED:
        readings["faulted"] = (1.0,)
    outcome, reason = judge(found)
    reason = "; ".join(filter(None, (*wrong, reason)))
    outcome = Outcome.FAIL if any(wrong) else outcome
    return Result(outcome, reason, tuple(found), RUNS_ON if runs_on else "", values, readings)


def _bench(stand: Stand, winch: int) -> TrialBench:
    if winch >= len(stand.rig.trials):
        raise OurBugError(f"The rig has no bench for trials of winch {winch + 1}.")
    return stand.rig.trials[winch]


async def _stopped(stand: Stand, step: ProveStop, winch: Winch, bench: TrialBench) -> list[Measurement]:
    """Time and way of the stop. Raises _WrongError where the winch does not move as told, or does not stop."""
    await winch.configure()
    if not await wait_until(stand.rig.clock, stand.settings.hold.timeout, lambda: winch.latest() is not None):
        raise DeviceError(winch.name, "no sample after configuring.", hint="Check power and bus.")
    await winch.enable()
    expected = bench.stop(step.trial, step.speed, step.acceleration)
    ramp = step.speed**2 / (2.0 * step.acceleration)
    allowed = expected.reaction + step.speed / expected.deceleration + stand.settings.commission.late
    longest = BEYOND * allowed + SLACK
    run_up = ramp + AHEAD * step.speed
    far = run_up + step.speed * longest + 2.0 * ramp
    start = await winch.ask_length()
    sign = next((sign for sign in (1, -1) if bench.room(start, sign * far)), 0)
    if not sign:
        raise DeviceError(
            winch.name,
            f"has no room for the trial: {far:.2f} m of cable to one side are needed.",
            hint="Wind or pay out, or widen its length_limits while there is no load.",
        )
    way = _Way(winch, stand, start, sign, stand.settings.commission.still)
    await bench.arm(step.trial, start + sign * 2.0 * run_up)
    await bench.start(start + sign * far, step.speed, step.acceleration)
    await _runs(way, run_up, step.speed / step.acceleration + BEGINS)
    await bench.provoke(step.trial)
    if step.trial is Trial.POSITION_LIMIT:
        return await _at_limit(way, 2.0 * run_up, longest)
    return await _stop(way, step, expected, longest)


async def _runs(way: _Way, run_up: float, within: float) -> None:
    clock = way.stand.rig.clock
    deadline = clock.now() + within
    while (gone := await way.look()) < run_up:
        if gone < -2.0 * way.still:
            raise _WrongError(f"it moves in the wrong direction: {gone * 1e3:+.1f} mm")
        if clock.now() > deadline:
            raise _WrongError(
                f"its encoder moved {gone * 1e3:.1f} mm in {within:.1f} s, {run_up * 1e3:.1f} mm were commanded: "
                "the drum stands still, or the encoder does not work"
            )


async def _stop(way: _Way, step: ProveStop, expected: TrialStop, longest: float) -> list[Measurement]:
    began, place = way.seen[-1]
    ramp = step.speed / expected.deceleration
    while not way.stands():
        gone = await way.look() - place
        if way.seen[-1][0] - began > longest + SETTLED:
            raise _WrongError(f"it does not stop: {gone * 1e3:.0f} mm in {longest:.1f} s")
    stopped, rest = way.moved_last()
    late = expected.reaction + way.stand.settings.commission.late
    return [
        Measurement("time to standstill", max(stopped - began, 0.0), "s", high=ramp + late),
        Measurement("distance to standstill", rest - place, "m", high=step.speed * (late + 0.5 * ramp)),
    ]


async def _at_limit(way: _Way, limit: float, longest: float) -> list[Measurement]:
    began = way.seen[-1][0]
    while not way.stands():
        gone = await way.look()
        if way.seen[-1][0] - began > longest + SETTLED:
            raise _WrongError(f"it passes its position limit by {(gone - limit) * 1e3:.0f} mm and does not stop")
    stopped, rest = way.moved_last()
    late = way.stand.settings.commission.late
    crossed = next((t for t, gone in way.seen if gone >= limit), stopped)
    return [
        Measurement("time to standstill beyond the limit", max(stopped - crossed, 0.0), "s", high=late),
        Measurement("distance beyond the limit", rest - limit, "m", high=way.stand.settings.guard.motion),
    ]


async def _stays(stand: Stand, step: ProveStop, winch: Winch, found: list[Measurement]) -> tuple[str, bool]:
    """What is wrong with a winch that has stopped (it moves on, or is enabled again), and whether it is in fault."""
    clock = stand.rig.clock
    before, since = await winch.ask_length(), clock.now()
    states: set[DriveState] = set()
    while clock.now() - since < step.watch:
        await clock.sleep(POLL)
        sample = winch.latest()
        if sample is not None and sample.t > since:
            states.add(sample.state)
    moved = abs(await winch.ask_length() - before)
    found.append(Measurement("moved after it had stopped", moved, "m", high=stand.settings.hold.still))
    if step.trial not in STAYS_ENABLED and DriveState.OPERATION_ENABLED in states:
        return f"afterwards it is in “{DriveState.OPERATION_ENABLED}” without a command", False
    return "", DriveState.FAULT in states


async def _without_power(stand: Stand, step: ProveStop, winch: Winch, found: list[Measurement]) -> str:
    """Whether it stays without power; why the drive is not as it should be then."""
    clock = stand.rig.clock
    await clock.sleep(stand.rig.trials[step.winch].brake_time)
    before = await winch.ask_length()
    await clock.sleep(step.watch)
    moved = abs(await winch.ask_length() - before)
    found.append(Measurement("moved without power", moved, "m", high=stand.settings.hold.still))
    try:
        for tried in stand.rig.trials:  # what is withheld from one is withheld from all of its bus
            await tried.recover()
    except DeviceError as error:
        return f"its fault could not be acknowledged: {error.message.rstrip('.')}"
    return ""


async def _made_to_stop(stand: Stand, winch: Winch) -> str:
    """Stop a winch that did not do as it should, by stronger and stronger means; says so where only power-off did."""
    for stop in (winch.quick_stop, winch.force_stop):
        stop()
        if await _comes_to_rest(stand, winch):
            return ""
    winch.power_off()
    rests = await _comes_to_rest(stand, winch)
    return "neither a quick stop nor NMT stop stopped it" + (
        "; it stopped when its power was switched off" if rests else "; it still moves: cut the power by hand"
    )


async def _comes_to_rest(stand: Stand, winch: Winch) -> bool:
    clock = stand.rig.clock
    await clock.sleep(PATIENCE)
    before = await winch.ask_length()
    await clock.sleep(SETTLED)
    return abs(await winch.ask_length() - before) <= stand.settings.hold.still
