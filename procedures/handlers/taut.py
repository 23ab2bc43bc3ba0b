"""Handlers that take up slack by torque, one cable after another, and take the power away again."""

import asyncio
from collections.abc import Awaitable

from drivers.ports import DriveState
from fidim_lab.errors import DeviceError, RefusedError
from procedures.expected.tensions import current_for
from procedures.handlers.motion import command_all, require_alone
from procedures.outcomes import Measurement, Outcome, judge
from procedures.stand import Stand
from procedures.steps import Result
from procedures.steps.taut import TakePower, TakeUp
from procedures.timing import POLL


async def take_up(stand: Stand, step: TakeUp) -> Result:
    """Enable all, then pull one after another while the others are watched. Raises as `PullTaut`, or RefusedError."""
    rig, bands = stand.rig, stand.settings.tension.bands
    if len(rig.pulls) != len(rig.winches):
        raise RefusedError("The winches of this rig cannot take up slack in torque mode.")
    require_alone(stand)
    await command_all([winch.enable() for winch in rig.winches])
    wound: list[float] = []
    for index, pull in enumerate(rig.pulls):
        newton = current_for(step.tension, None if bands is None else bands[index])
        current = newton / stand.newton_per_ampere[index]
        wound.append(await _watched(stand, index, pull(current, step.speed, step.way)))
        stand.progress((index + 1) / len(rig.pulls))
    found = tuple(Measurement(f"slack of cable {cable}", way, "m", high=step.way) for cable, way in enumerate(wound, 1))
    outcome, reason = judge(found)
    return Result(outcome, reason, found, values=tuple(wound))


async def _watched(stand: Stand, pulled: int, pull: Awaitable[float]) -> float:
    """The pull, ended where another winch does not hold any more. Raises DeviceError naming that one."""
    work = asyncio.ensure_future(pull)
    try:
        while not work.done():
            for index, winch in enumerate(stand.rig.winches):
                sample = stand.sample(index)
                if index != pulled and (sample.fault or sample.state is not DriveState.OPERATION_ENABLED):
                    says = sample.fault or f"is in “{sample.state}”"
                    raise DeviceError(
                        winch.name, f"{says} while slack is taken up at {stand.rig.winches[pulled].name}."
                    )
            await asyncio.wait({work}, timeout=0.0)
            await stand.rig.clock.sleep(POLL)
        return work.result()
    finally:
        if not work.done():
            work.cancel()
            await asyncio.gather(work, return_exceptions=True)


async def take_power(stand: Stand, step: TakePower) -> Result:
    """Power off, then compare each encoder, asked outside the bus cycle."""
    winches, clock = stand.rig.winches, stand.rig.clock
    before = [await winch.ask_length() for winch in winches]
    for winch in winches:
        winch.power_off()
    await clock.sleep(step.over)
    moved = [abs(await winch.ask_length() - was) for winch, was in zip(winches, before, strict=True)]
    found = tuple(
        Measurement(f"cable {cable} moved without power", way, "m", high=step.still)
        for cable, way in enumerate(moved, start=1)
    )
    outcome, reason = judge(found)
    if outcome is Outcome.FAIL:
        reason += ": do the brakes hold?"
    return Result(outcome, reason, found)
