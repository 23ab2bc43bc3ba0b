"""The findings of cleaning, added to verdict, effects, places and message of an explanation."""

from dataclasses import replace

from fidim_lab.effects.effect import HandContact
from fidim_lab.identification.markers.finding import Finding
from fidim_lab.mismatch.cleaning.clean import Cleaned
from fidim_lab.mismatch.cleaning.contacts import Contact
from fidim_lab.mismatch.conclusion.explanation import Explanation, MismatchPlace, NamedCause, Verdict
from fidim_lab.mismatch.conclusion.parts import EffectParameter
from fidim_lab.mismatch.thresholds import SHARED

MOST_PLACES = 6
"""faults that are listed each in a place of its own; the others are counted in the message"""


def with_cleaning(explanation: Explanation, cleaned: Cleaned) -> Explanation:
    """The answer to the campaign as it was recorded.

    Contacts are effects of their own. Faults alone make the verdict "sensor-fault" where the cleaned campaign lacks
    nothing, or contradicts its kinematics in a way that has no name, as no force does; where physics is missing too it
    is named, and the faults are said.
    """
    effects, verdict = explanation.effects, explanation.verdict
    if cleaned.contacts:
        effects = (_hand(cleaned.contacts), *effects)
        verdict = {
            Verdict.NOTHING_MISSING: Verdict.EXPLAINED,
            Verdict.UNKNOWN_PHYSICS: Verdict.PARTLY_EXPLAINED,
        }.get(verdict, verdict)
    elif _sensors_alone(cleaned, verdict):
        verdict = Verdict.SENSOR_FAULT
    return replace(
        explanation,
        verdict=verdict,
        effects=effects,
        where=(*_places(cleaned), *explanation.where),
        message=_message(explanation, cleaned, verdict),
    )


def _sensors_alone(cleaned: Cleaned, verdict: Verdict) -> bool:
    """Whether faults of sensors are all that is known to be wrong."""
    if verdict is Verdict.UNKNOWN_PHYSICS:
        return len(cleaned.faults) >= SHARED.repeated and cleaned.screening.contradicts_kinematics
    return bool(cleaned.faults) and verdict is Verdict.NOTHING_MISSING


def _hand(contacts: tuple[Contact, ...]) -> NamedCause:
    parameters: dict[str, EffectParameter] = {}
    for number, contact in enumerate(contacts, start=1):
        ours = [k for k, other in enumerate(contacts, start=1) if other.window == contact.window]
        suffix = "" if len(ours) == 1 else f" {ours.index(number) + 1}"
        parameters[f"{contact.window} begin{suffix}"] = EffectParameter(contact.begin, contact.sd, "s")
        parameters[f"{contact.window} end{suffix}"] = EffectParameter(contact.end, contact.sd, "s")
    says = "an unknown wrench during part of a window, such as an operator's hand; these times are not fitted"
    return NamedCause(HandContact.id, None, (), parameters, says, single=True)


def _places(cleaned: Cleaned) -> tuple[MismatchPlace, ...]:
    contacts = [MismatchPlace(c.window, (c.begin, c.end), "all", None, 0.0, c.says) for c in cleaned.contacts]
    faults = sorted(cleaned.faults, key=lambda fault: -fault.size)
    return (
        *contacts,
        *(_place(fault) for fault in faults[:MOST_PLACES] if fault.window is not None),
    )


def _place(fault: Finding) -> MismatchPlace:
    return MismatchPlace(fault.window or "", fault.t or (0.0, 0.0), fault.channel, None, 0.0, fault.says)


def _message(explanation: Explanation, cleaned: Cleaned, verdict: Verdict) -> str:
    said = list(cleaned.says)
    if verdict is Verdict.SENSOR_FAULT:
        head = "A sensor is at fault, not the physics: without the faulty samples nothing is missing."
        if explanation.verdict is not Verdict.NOTHING_MISSING:
            head = "Sensors are at fault: some samples fit no motion, and no force explains the rest."
            said.append(cleaned.kinematics or "")
        return " ".join([head, *said, explanation.message])
    if cleaned.contacts:
        several = len(cleaned.contacts) > 1
        hands = f"{len(cleaned.contacts)} contact{'s' * several}, such as an operator's hand, "
        said.insert(0, f"{hands}{'were' if several else 'was'} cut out first.")
    elif said:
        said.insert(0, "Faulty samples were cut out first.")
    said.append(explanation.message)
    if explanation.verdict is not Verdict.NOTHING_MISSING and cleaned.kinematics is not None:
        said.append(cleaned.kinematics)
    return " ".join(said)
