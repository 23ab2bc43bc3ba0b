"""Why windows are not used, in words that name each window once."""

from collections.abc import Mapping, Sequence

ALL_NAMED = 6
"""windows that fit into a line of 80 characters"""


def bare(window: str, why: str) -> str:
    """A refusal without the window's name before it, for a sentence that names it already."""
    return why.removeprefix(f"Window {window}").removeprefix(":").strip()


def together(unused: Mapping[str, str]) -> str:
    """Window id → why, as one text: windows with the same reason, figures apart, share the first one's words."""
    kinds: dict[str, list[str]] = {}
    for name, why in unused.items():
        kind = " ".join(word for word in bare(name, why).split() if not any(letter.isdigit() for letter in word))
        kinds.setdefault(kind, []).append(name)
    said: list[str] = []
    for names in kinds.values():
        first = bare(names[0], unused[names[0]])
        said.append(f"{_named(names)}: {first}")
    return "; ".join(said)


def _named(names: Sequence[str]) -> str:
    """Whose words these are; of many windows the first ones and the last."""
    if len(names) == 1:
        return names[0]
    if len(names) <= ALL_NAMED:
        return f"{', '.join(names)} (figures of {names[0]})"
    return f"{len(names)} windows ({', '.join(names[:2])}, … {names[-1]}; figures of {names[0]})"


def no_sigma(why: Mapping[str, str]) -> str:
    """Window id → why it has no σ⊥, as a sentence for below a table; empty without any."""
    if len(reasons := set(why.values())) == 1:
        return f"σ⊥ – in {'every one' if len(why) > 1 else next(iter(why))}: {reasons.pop()}"
    return f"σ⊥ –: {together(why)}" if why else ""
