"""Every stop of every winch, proven by trial: without load, at low speed, with a person present.

For each winch a quick stop first (the means by which the others are ended, where a drive does not stop by itself), then
halt, heartbeat and SYNC withheld, the drive's position limit, its following-error limit. The plan has a window for each
winch, whose name it bears. What passes is a proof, which the application keeps with the rig.
"""

from collections.abc import Generator, Mapping

from drivers.ports import Trial
from fidim_lab.data.records import Plan
from fidim_lab.errors import SetupError
from procedures.outcomes import Outcome, worst
from procedures.protocols.beginning import ask_without_power
from procedures.protocols.experiment import Lab
from procedures.settings import Settings
from procedures.steps import Configure, GiveUpWithoutPower, Result, Step, Steps, Stop
from procedures.steps.commission import RUNS_ON, ProveStop

TRIALS = tuple(Trial)
"""in this order"""
ONE_IS_ENOUGH = (Trial.LOST_HEARTBEAT, Trial.LOST_SYNC)
"""reactions to a lost host: a drive needs one of them"""


def commission(lab: Lab) -> Steps:
    """The steps. Raises SetupError for a plan that has not one window for each winch."""
    plan = lab.plan
    if len(plan.windows) != lab.robot.n:
        raise SetupError(f"Plan {plan.name!r} has {len(plan.windows)} windows; commissioning has one for each winch.")
    return _commission(plan, lab.settings)


def _commission(plan: Plan, settings: Settings) -> Steps:
    yield Configure()
    if (yield ask_without_power("", _WORD, settings)).answer != "done":
        yield Stop(outcome=Outcome.ABORTED, reason="left unchanged by the operator")
        return
    outcomes: list[Outcome] = []
    for index, window in enumerate(plan.windows):
        text = _NEXT.format(window.id)
        answer = (yield ask_without_power(window.id, text, settings, ("done", "skip", "abort"))).answer
        if answer == "abort":
            yield Stop(outcome=Outcome.ABORTED, reason="ended by the operator")
            return
        if answer == "skip":
            yield GiveUpWithoutPower(window=window.id, outcome=Outcome.SKIPPED, reason="skipped by the operator")
            outcomes.append(Outcome.SKIPPED)
            continue
        judged = judge_trials((yield from _tried(window.id, index, settings)))
        yield GiveUpWithoutPower(window=window.id, outcome=judged.outcome, reason=judged.reason)
        outcomes.append(judged.outcome)
    yield Configure()
    proven = sum(outcome.usable for outcome in outcomes)
    yield Stop(outcome=worst(outcomes), reason=f"{proven} of {len(outcomes)} winches stop by themselves in every trial")


def judge_trials(results: Mapping[Trial, Result]) -> Result:
    """A winch passes where every trial that its drive can undergo has passed; of `ONE_IS_ENOUGH` one must."""
    watched = any(results[trial].outcome.usable for trial in ONE_IS_ENOUGH if trial in results)
    said = [
        f"{trial}: {'no reaction, and none is needed' if _unneeded(trial, result, watched) else _told(result)}"
        for trial, result in results.items()
    ]
    needed = [result.outcome for trial, result in results.items() if trial not in ONE_IS_ENOUGH]
    tried = [outcome for outcome in needed if outcome is not Outcome.SKIPPED]
    if not watched:
        tried.append(Outcome.FAIL)
        said.append("nothing stopped it when its host was lost")
    return Result(worst(tried), "; ".join(said))


def _unneeded(trial: Trial, result: Result, watched: bool) -> bool:
    """Whether a drive may leave this trial without a reaction, since it has another to a lost host."""
    return watched and trial in ONE_IS_ENOUGH and not result.outcome.usable


def _told(result: Result) -> str:
    if result.outcome.usable and result.values:
        time, way = result.values
        return f"{time:.2f} s, {way * 1e3:.1f} mm"
    return f"{result.outcome} ({result.reason})" if result.reason else str(result.outcome)


def _tried(window: str, index: int, settings: Settings) -> Generator[Step, Result, dict[Trial, Result]]:
    results: dict[Trial, Result] = {}
    told = settings.commission
    for trial in TRIALS:
        results[trial] = yield ProveStop(
            window=window,
            winch=index,
            trial=trial,
            speed=told.speed,
            acceleration=told.acceleration,
            watch=told.watch,
        )
        unstoppable = results[trial].answer == RUNS_ON
        if unstoppable or (trial is Trial.QUICK_STOP and not results[trial].outcome.usable):
            break  # what ends the other trials does not work on it
    return results


_WORD = (
    "The winches will move, one after another, and must stop by themselves; heartbeat and SYNC are withheld meanwhile. "
    "Is there no load on any cable, the platform on its stand, nobody within reach, and the emergency stop at hand?"
)
_NEXT = "Next is {0}: may it wind and pay out, at low speed, without load?"
