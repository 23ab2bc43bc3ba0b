"""Prompts and steps to have the platform displaced and let go, by a hand or by the rig's release device."""

from collections.abc import Callable, Generator, Sequence

from drivers.ports import Prompt, PromptKind
from fidim_lab.data.records import PlannedWindow, Robot
from procedures.settings import RecordSettings, ReleaseSettings, Settings
from procedures.steps import AwaitHeld, LetGo, Result, Step, TakeHold

NOISE_RANGE = 8.0
"""standard deviations of a marker's noise: peak to peak of some hundred samples at rest"""

Asking = Callable[[Prompt], Generator[Step, Result, str]]


def free(settings: Settings, window: str = "") -> Generator[Step, Result, None]:
    """Nothing may hold the platform when winches move."""
    if settings.release is not None:
        yield LetGo(window=window)


def displace(
    planned: PlannedWindow,
    robot: Robot,
    settings: Settings,
    rest: tuple[float, ...],
    reasons: Sequence[str],
    ask: Asking,
) -> Generator[Step, Result, tuple[str, str | None]]:
    """The steps until the platform is released; returns the operator's answer, and why the displacement was not good.

    rest: where the marker rested, m. reasons: why earlier attempts were rejected.
    """
    release = settings.release
    if release is None:
        prompt = _prompt(PromptKind.DISPLACE_AND_RELEASE, planned, reasons, "keep it still, and let go")
        return (yield from ask(prompt)), None
    yield TakeHold(window=planned.id)
    if release.by_hand:
        prompt = _prompt(PromptKind.HANG_IN, planned, reasons, "let the release take hold, and step back")
        if (answer := (yield from ask(prompt))) == "skip":
            yield LetGo(window=planned.id)
            return answer, None
    held = yield _held(planned, robot, settings.record, release, rest)
    yield LetGo(window=planned.id)
    return "done", None if held.outcome.usable else held.reason


def _held(
    planned: PlannedWindow, robot: Robot, record: RecordSettings, release: ReleaseSettings, rest: tuple[float, ...]
) -> AwaitHeld:
    """Still, and as far aside as a window may begin."""
    x, y = robot.limits.free_displacement
    return AwaitHeld(
        window=planned.id,
        equilibrium=rest,
        least=record.amplitude / 2.0,
        displacement=(record.displacement * x, record.displacement * y),
        still=max(release.still, NOISE_RANGE * robot.sensors.marker_noise),
        over=release.over,
        timeout=release.timeout,
    )


def _prompt(kind: PromptKind, planned: PlannedWindow, reasons: Sequence[str], rest: str) -> Prompt:
    wanted = tuple(float(v) for v in planned.displacement)
    where = ", ".join(f"{axis} {round(value * 1e3):+d} mm" for axis, value in zip("xyz", wanted, strict=False))
    again = f"Not accepted: {reasons[-1]}. Again: d" if reasons else "D"
    return Prompt(kind, f"{again}isplace the platform by {where}, {rest}.", displacement=wanted)
