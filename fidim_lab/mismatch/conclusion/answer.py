"""The answer in four short parts: verdict, what is certain, what is not known, what to do next.

Words of an explanation whose values are all there already; the parts of one answer have under 120 words.
"""

from collections.abc import Iterable
from dataclasses import replace
from math import floor, isfinite, log10

from fidim_lab.effects.equivalences import held_by, shared_by
from fidim_lab.identification.mle.geometry_words import furthest
from fidim_lab.identification.results.result import ShortAnswer
from fidim_lab.mismatch.conclusion.explanation import Explanation, NamedCause, Verdict
from fidim_lab.mismatch.conclusion.parts import EffectParameter
from fidim_lab.mismatch.thresholds import SHARED
from fidim_lab.units import millimetres, plain

MOST_CAUSES = 3
"""listed in a part; the tables have all"""
MOST_WORDS = 54
"""of a part, less those that say what is left out: "under 60" is promised"""
MOST_SIZES = 2
"""parameters listed of each"""
MOST_MEMBERS = 2
"""listed of a class beside its first"""
NOT_WHITE = {
    "lengths": "Why cable lengths change within windows although the winches are held.",
    "currents": "Why motor currents do not follow the tensions of the model: friction at the winches, for example.",
    "swivels": "Why the swivels do not follow their cables: one that sticks, for example.",
}
"""said of a channel that shows more than noise, where the markers show no more"""
HEADS = {
    Verdict.NOTHING_MISSING: "Nothing is missing.",
    Verdict.EXPLAINED: "Left out: {names}.",
    Verdict.PARTLY_EXPLAINED: "Left out: {names}; something else remains unexplained.",
    Verdict.UNKNOWN_PHYSICS: "Something is missing that no effect tested here explains.",
    Verdict.SENSOR_FAULT: "A sensor is at fault, not the physics.",
}


def with_answer(told: Explanation) -> Explanation:
    """The explanation with its four parts."""
    names = ", ".join(dict.fromkeys(_class(cause) for cause in told.effects))
    answer = ShortAnswer(
        verdict=f"{HEADS[told.verdict].format(names=names)} {_figures(told)}".strip(),
        certain=_short(_certain(told)) or "Nothing beyond the verdict.",
        not_known=_short([*_doubtful(told), *_open(told.effects)]) or _all_told(told),
        next=_next(told),
    )
    return replace(told, answer=answer)


def _short(said: Iterable[str]) -> str:
    """The first of these, each whole, as far as they go; how many are left out is said."""
    told, words = list(dict.fromkeys(said)), 0
    for k, one in enumerate(told):
        words += len(one.split())
        if words > MOST_WORDS and k > 0:
            return f"{' '.join(told[:k])} {len(told) - k} more in the tables."
    return " ".join(told)


def _figures(told: Explanation) -> str:
    """How well windows are predicted, and which windows these are."""
    chi2, rms = told.chi2_per_dof, told.rms_mm
    which = "held-out windows, which were also used to choose the model"
    for figures, words in (
        (told.left_out, "each window predicted from the others"),
        (told.test, "test windows, used only here"),
    ):
        if figures is not None:
            chi2, rms, which = figures.chi2_per_dof, figures.rms_mm, words
    if chi2.after is None or not isfinite(chi2.after) or rms.after is None:
        return "No window was held out to test it."
    if told.verdict is Verdict.NOTHING_MISSING and told.geometry is None:
        return f"χ²/dof {plain(chi2.after)}, {rms.after:.2g} mm ({which})."
    before = "–" if chi2.before is None or not isfinite(chi2.before) else plain(chi2.before)
    return f"χ²/dof {before} → {plain(chi2.after)}, {rms.after:.2g} mm ({which})."


def _certain(told: Explanation) -> Iterable[str]:
    """Single names with their sizes, classes by what they share, and the geometry."""
    drifts = {reading.id for reading in told.readings}
    for cause in [cause for cause in told.effects if cause.id not in drifts][:MOST_CAUSES]:
        if cause.single:
            yield f"{_name(cause)}{_sizes(cause.parameters)}."
        else:
            shared = shared_by(_alike(cause))
            if shared is not None:
                yield f"{shared[0].upper()}{shared[1:]}, whatever its place."
    if told.verdict is not Verdict.UNKNOWN_PHYSICS:
        yield from (reading.says for reading in told.readings)
    if told.law:
        yield f"It acts like {', '.join(f'{term.like}{_sizes(term.parameters)}' for term in told.law)}."
    if told.geometry is not None and told.geometry.moved:
        off = [value for one in told.geometry.moved if one.what == "anchor" for value in one.by]
        if off:
            rms = (sum(value**2 for value in off) / len(off)) ** 0.5
            shown = f"{millimetres(rms):.2g} mm rms, as far as the recordings show"
            yield f"The anchors in the robot file are wrong by {shown}; every ± includes this."


def _doubtful(told: Explanation) -> Iterable[str]:
    """Errors of readings under a model that leaves more than noise, and channels that show more than the markers."""
    if told.readings and told.verdict is Verdict.UNKNOWN_PHYSICS:
        yield f"Whether this error is real, or an image of the missing physics: {told.readings[0].says}"
    if told.verdict in (Verdict.NOTHING_MISSING, Verdict.EXPLAINED):
        yield from (NOT_WHITE[one.channel] for one in told.channels if not one.white and one.channel in NOT_WHITE)


def _all_told(told: Explanation) -> str:
    return (
        "Nothing; each named effect has odds over 20 to 1 against its rivals."
        if told.effects
        else "No effect was named."
    )


def _open(effects: Iterable[NamedCause]) -> Iterable[str]:
    """Classes, each with its members' sizes and weights, in words."""
    for cause in [cause for cause in effects if not cause.single][:MOST_CAUSES]:
        members = [f"{_name(cause)}{_sizes(cause.parameters)}"]
        for member in cause.likely[:MOST_MEMBERS]:
            members.append(f"{member.id}{_sizes(member.parameters)}")
        if len(members) == 1:
            members += held_by(cause.id)[:MOST_MEMBERS] or ("an effect that is not listed",)
        else:
            members[-1] += f" ({100 * cause.weights[0]:.0f} % for the first)"
        yield f"Whether it is {' or '.join(members)}."


def _class(cause: NamedCause) -> str:
    """A single name, or what a class shares."""
    if cause.single:
        return _name(cause)
    return shared_by(_alike(cause)) or f"{_name(cause)} or a similar effect"


def _alike(cause: NamedCause) -> tuple[str, ...]:
    """Ids of the cause, of its members, and of what the cause can do in any data."""
    return (cause.id, *(member.id for member in cause.members), *held_by(cause.id))


def _name(cause: NamedCause) -> str:
    return cause.id if cause.cable is None else f"{cause.id} (cable {cause.cable})"


def _sizes(parameters: dict[str, EffectParameter]) -> str:
    """The first few, to the digits of their sd; first what is beyond chance, or the largest of one unit without sd."""
    values = parameters.values()
    by_size = len({one.unit for one in values}) == 1 and all(one.sd is None for one in values)
    leading = sorted(parameters.items(), key=lambda named: -abs(named[1].value) if by_size else not _seen(named[1]))
    said = [f"{name} = {_value(value)} {value.unit}".removesuffix(" 1") for name, value in leading[:MOST_SIZES]]
    return f": {', '.join(said)}" if said else ""


def _seen(value: EffectParameter) -> bool:
    return value.sd is not None and isfinite(value.sd) and abs(value.value) > SHARED.certain * value.sd


def _value(found: EffectParameter) -> str:
    """With one digit of its sd; without a sd where it is held, or where only its nearest size is known."""
    sd = found.sd
    if sd is None or not isfinite(sd) or not sd > 0 or not found.value:
        return f"{found.value:.3g}"
    digits = floor(log10(abs(found.value))) - floor(log10(sd)) + 1
    return f"{plain(found.value, max(1, digits))} ± {plain(sd, 1)}"


def _next(told: Explanation) -> str:
    if told.readings:
        return " ".join(dict.fromkeys(reading.next for reading in told.readings))
    if told.next_experiment is not None:
        return told.next_experiment
    if any(not cause.single for cause in told.effects):
        return "Record windows that separate them: `fidim design --after explanation.json` proposes some."
    if told.geometry is not None and not told.geometry.stated:
        return "State [survey] in the robot file, or measure the anchors again."
    if told.geometry is not None and furthest(told.geometry, explained=True):
        return "Measure again what is clearly wrong, or state a larger uncertainty for it in [survey]."
    return "Nothing more is needed."
