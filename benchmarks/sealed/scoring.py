"""Whether an explanation is right: by name, by class, or wrong."""

from enum import StrEnum
from itertools import product
from typing import Any

from fidim_lab.effects.equivalences import GEOMETRY, SHARED

EQUIVALENTS = 3
"""so many alternatives of an effect are read; who names more names nothing"""


class Marked(StrEnum):
    """How an explanation is judged."""

    RIGHT = "right"
    CLASS = "class"
    """right only through `equivalent_to`"""
    WRONG = "wrong"

    @property
    def good(self) -> bool:
        """Right, or right by class."""
        return self is not Marked.WRONG


ALONE: dict[tuple[str, ...], str] = {
    (): "nothing-missing",
    ("unknown",): "unknown-physics",
    ("sensor-fault",): "sensor-fault",
}
"""secrets that a verdict names, without an effect"""


def grade(explanation: dict[str, Any] | None, label: list[str], cable: int | None) -> Marked:
    """Judge one explanation ("fidim-explanation/1" as a table; None: there is none) against what was hidden.

    right: the named effects are exactly the hidden ones, with the cable where the truth gives one, or the verdict is
    the one for nothing, something unknown or a sensor fault. class: some choice of effects and their equivalents is.
    """
    if explanation is None:
        return Marked.WRONG
    verdict, effects = explanation.get("verdict"), explanation.get("effects", [])
    if tuple(label) in ALONE:
        return Marked.RIGHT if verdict == ALONE[tuple(label)] and not effects else Marked.WRONG
    if verdict not in ("explained", "partly-explained"):
        return Marked.WRONG
    hidden = sorted(label)
    cable_right = cable is None or cable in {effect.get("cable") for effect in effects}
    if verdict == "explained" and cable_right and sorted(effect["id"] for effect in effects) == hidden:
        return Marked.RIGHT
    choices = [[effect["id"], *effect.get("equivalent_to", [])[:EQUIVALENTS]] for effect in effects]
    return Marked.CLASS if any(sorted(choice) == hidden for choice in product(*choices)) else Marked.WRONG


def grade_surveyed(explanation: dict[str, Any] | None, label: list[str], cable: int | None) -> Marked:
    """Judge an explanation of recordings that came with a robot file which is off by survey errors, as `grade` does.

    class, too: pieces of the geometry, which is off in all of them, stand beside the right names, none of them as the
    only name for it; what is hidden of the geometry is told by such pieces, or by no name, as clearly off.
    """
    judged = grade(explanation, label, cable)
    if judged.good or explanation is None:
        return judged
    pieces = [one for one in explanation.get("effects", []) if one["id"] in SHARED[GEOMETRY] and not one["single"]]
    others = [one for one in explanation.get("effects", []) if one not in pieces]
    moved, rest = set(label) & set(SHARED[GEOMETRY]), [id for id in label if id not in SHARED[GEOMETRY]]
    if not all(pieces or _told_off(explanation, id, cable) for id in moved):
        return Marked.WRONG
    if rest:
        right = grade({**explanation, "effects": others}, rest, None if moved else cable).good
    else:
        right = not others and bool(pieces or moved)
    return Marked.CLASS if right else Marked.WRONG


def sure(explanation: dict[str, Any] | None, label: list[str]) -> bool:
    """Whether something that was not hidden has the only name (odds over 20)."""
    return any(one["id"] not in label for one in (explanation or {}).get("effects", []) if one.get("single"))


def covers(explanation: dict[str, Any] | None, label: list[str]) -> bool | None:
    """Whether all that is hidden stands among the names and what is not told from them; None where nothing is named."""
    effects = (explanation or {}).get("effects", [])
    told = {id for one in effects for id in (one["id"], *one["equivalent_to"], *one.get("further_equivalent", ()))}
    return set(label) <= told if effects else None


CLEARLY = 5.0
"""standard deviations by which a place must be told off"""


def grade_without(explanation: dict[str, Any] | None, hidden: str = "", cable: int | None = None) -> Marked:
    """Judge an explanation of something that its catalogue lacks, the effect `hidden` (with its cable).

    right: it is called unknown. class: neighbours are named, none of them as the only one; or it belongs to the
    geometry, and that is reported to be clearly off (at its cable). wrong: a name that claims odds over 20 is wrong and
    sure; so is any other "nothing is missing".
    """
    if explanation is None:
        return Marked.WRONG
    effects = explanation.get("effects", [])
    if explanation.get("verdict") == "unknown-physics":
        return Marked.RIGHT
    if not effects:
        return Marked.CLASS if _told_off(explanation, hidden, cable) else Marked.WRONG
    return Marked.WRONG if any(effect.get("single") for effect in effects) else Marked.CLASS


def _told_off(explanation: dict[str, Any], hidden: str, cable: int | None) -> bool:
    """Whether the geometry is told to be off where the hidden effect is one of it."""
    if hidden not in SHARED[GEOMETRY]:
        return False
    moved = (explanation.get("geometry") or {}).get("moved", ())
    own = (m for m in moved if cable in (None, m["cable"]))
    return any(abs(by) > CLEARLY * sd for m in own for by, sd in zip(m["by"], m["sd"], strict=True))


def named(explanation: dict[str, Any] | None) -> str:
    """What an explanation says, in a word or two, for tables."""
    if explanation is None:
        return "no answer"
    effects = explanation.get("effects", [])
    if not effects:
        return str(explanation.get("verdict"))
    names = " + ".join(_with_cable(effect) for effect in effects)
    return names if explanation.get("verdict") == "explained" else f"{names} ({explanation.get('verdict')})"


def _with_cable(effect: dict[str, Any]) -> str:
    return effect["id"] if effect.get("cable") is None else f"{effect['id']}[{effect['cable']}]"
