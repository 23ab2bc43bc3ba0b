"""`fidim run`: start a service for a plan on a rig, and watch it from this terminal.

The service is a process of its own: this one may be killed or its terminal closed, and the run goes on. Ctrl-C here
aborts the run (a second one, too, only asks); the robot is held before the service ends.
"""

import getpass
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from drivers.ports import Prompt, PromptKind
from fidim_lab.app.formats.answer_file import write_answer, write_summary
from fidim_lab.app.formats.run_spec import AnswerSpec, RunSpec, UnattendedSpec
from fidim_lab.app.service.main import Work, prepare
from fidim_lab.app.service.place import place_of
from fidim_lab.app.session.after_run import advise
from fidim_lab.app.session.left_holding import left_by, power_advice
from fidim_lab.app.session.run_process import start_and_watch
from fidim_lab.app.session.undo_stop import confirmed
from fidim_lab.app.terminal import console
from fidim_lab.errors import SetupError
from procedures.protocols.catalogue import never_asks
from procedures.protocols.listing import Outline
from procedures.recording.run_folder import free_folder, require_new
from procedures.steps import Ask, Step

LISTING = "fidim-listing/1"


@dataclass(frozen=True)
class RunOptions:
    """As on the command line."""

    plan: Path
    rig: Path
    out: Path | None
    embedded: bool
    listing: bool
    unattended: bool
    answers: tuple[str, ...]
    """KIND=CHOICE[@SECONDS]"""
    settings: tuple[str, ...]
    """TABLE.KEY=VALUE"""
    max_hours: float | None
    quiet_hours: str | None
    """HH:MM-HH:MM"""
    on_finish: str
    on_fault: str
    seed: int
    hide: tuple[str, ...]
    procedure: str
    stay: bool
    tcp: int | None
    json_file: Path | None = None
    operator: str | None = None
    """who records; None: the user of this computer"""
    note: str = ""


def run_command(options: RunOptions) -> int:
    """Check, start, watch; returns the run's exit code. Raises FidimError before anything has moved."""
    spec = make_spec(options)
    if options.listing:
        work = prepare(spec)
        outline = Outline(work.experiment.procedure)
        _refuse_answers(work, _asked(work, outline.steps))
        console.out.print(outline.text(), end="", markup=False)
        write_answer(options.json_file, LISTING, _listed(outline))
        return 0
    require_new(spec.out)
    if spec.alone:
        confirmed(spec, asks=False)
    work = prepare(spec)
    require_answers(work)
    place = place_of(work.file, embedded=spec.embedded)
    left = left_by(place)
    code = start_and_watch(spec, place, confirmed(spec, asks=not spec.alone))
    advise(spec, code, power_advice(spec.out, spec.rig, left))
    write_summary(options.json_file, spec.out, code)
    return code


def _listed(outline: Outline) -> dict[str, object]:
    """Every step with its estimated time, s."""
    steps = [
        {"window": s.window, "step": type(s).__name__, "text": s.text, "seconds": s.seconds} for s in outline.steps
    ]
    least, most = outline.between
    estimate = {"seconds": outline.seconds, "seconds_least": least, "seconds_most": most}
    return {**estimate, "windows": list(outline.windows), "steps": steps}


def make_spec(options: RunOptions) -> RunSpec:
    """Options as a specification. Raises SetupError for what cannot be."""
    answers = dict(_answer(text) for text in options.answers)
    unattended = None
    if options.unattended or answers or options.max_hours is not None or options.quiet_hours is not None:
        unattended = UnattendedSpec(
            answers=answers, max_hours=options.max_hours, quiet_hours=_quiet_hours(options.quiet_hours)
        )
    return RunSpec(
        plan=options.plan.absolute(),
        rig=options.rig.absolute(),
        out=(options.out or free_folder(options.plan.stem)).absolute(),
        procedure=_procedure(options.procedure),
        settings=dict(_setting(text) for text in options.settings),
        embedded=options.embedded,
        seed=options.seed,
        hide=options.hide,
        unattended=unattended,
        alone=options.unattended,
        on_finish=options.on_finish,
        on_fault=options.on_fault,
        stay=options.stay,
        tcp_port=options.tcp,
        operator=_user() if options.operator is None else options.operator,
        note=options.note,
    )


def _user() -> str:
    """Of this computer; empty where it does not know."""
    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return ""


def require_answers(work: Work) -> None:
    """Raise SetupError for an answer to a prompt that cannot come, or an unattended run without one for each kind."""
    asked = _asked(work, Outline(work.experiment.procedure).steps)
    _refuse_answers(work, asked)
    answers = _answers(work)
    missing = [kind.value for kind in asked if kind not in answers]
    if work.spec.alone and missing:
        raise SetupError(
            f"--unattended, but these prompts have no answer: {', '.join(missing)}.",
            hint="Give an answer to each, or run without --unattended: "
            + "; ".join(f"--answer {kind}={' or '.join(asked[PromptKind(kind)])}" for kind in missing)
            + ". KIND=CHOICE@S answers after S seconds. excite and compare-by-winches have no prompts.",
        )


def _answers(work: Work) -> Mapping[PromptKind, AnswerSpec]:
    return work.spec.unattended.answers if work.spec.unattended else {}


def _asked(work: Work, steps: Sequence[Step]) -> dict[PromptKind, tuple[str, ...]]:
    """Kinds of prompts that may come with these steps, each with all that may be answered."""
    prompts = [step.prompt for step in steps if isinstance(step, Ask)]
    if any(step.window for step in steps) and not never_asks(
        work.spec.procedure
    ):  # a platform that does not come to rest is asked to be steadied
        prompts.append(Prompt(PromptKind.STEADY, "Bring the platform to rest."))
    asked: dict[PromptKind, tuple[str, ...]] = {}
    for prompt in prompts:
        asked[prompt.kind] = tuple(dict.fromkeys((*asked.get(prompt.kind, ()), *prompt.choices)))
    return asked


def _refuse_answers(work: Work, asked: Mapping[PromptKind, tuple[str, ...]]) -> None:
    """Raise SetupError for one that no prompt offers. A procedure of one's own may ask what its list does not show."""
    for kind, answer in _answers(work).items():
        choices = asked.get(kind)
        if choices is None and not work.spec.procedure.endswith(".py"):
            what = f"its prompts are {', '.join(asked)}" if asked else "it has no prompts"
            raise SetupError(f"--answer {kind}={answer.choice}: {work.spec.procedure} has no such prompt; {what}.")
        if choices is not None and answer.choice not in choices:
            raise SetupError(f"--answer {kind}={answer.choice}: the choices are {', '.join(choices)}.")


def _procedure(name: str) -> str:
    """A file by its absolute path, for the service works elsewhere."""
    return str(Path(name).absolute()) if name.endswith(".py") else name


def _quiet_hours(text: str | None) -> tuple[str, str] | None:
    if text is None:
        return None
    begin, _, end = text.partition("-")
    try:
        span = UnattendedSpec(quiet_hours=(begin, end)).quiet_hours
    except ValueError:
        raise SetupError(f"--quiet-hours {text}: HH:MM-HH:MM is expected, from 00:00 to 23:59.") from None
    if begin == end:
        raise SetupError(f"--quiet-hours {text}: begin and end are the same time.")
    return span


def _answer(text: str) -> tuple[PromptKind, AnswerSpec]:
    kind, _, rest = text.partition("=")
    choice, _, after = rest.partition("@")
    try:
        return PromptKind(kind), AnswerSpec(choice=choice, after=float(after or 0.0))
    except ValueError:
        kinds = ", ".join(kind.value for kind in PromptKind)
        raise SetupError(
            f"--answer {text}: KIND=CHOICE or KIND=CHOICE@SECONDS is expected; kinds are {kinds}."
        ) from None


def _setting(text: str) -> tuple[str, float]:
    key, _, value = text.partition("=")
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise SetupError(f"--set {text}: TABLE.KEY=NUMBER is expected, as record.seconds=8.")
    return key, number
