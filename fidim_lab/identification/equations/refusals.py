"""Why windows are not used, in words that name each window once."""

from collections.abc import Mapping


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
        others = f", {', '.join(names[1:])} (figures of {names[0]})" if len(names) > 1 else ""
        said.append(f"{names[0]}{others}: {first}")
    return "; ".join(said)
