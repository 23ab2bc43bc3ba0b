"""The page docs/cia402.md from the tables of `machine`: `python -m docs.tools.cia402 docs/cia402.md`."""

import sys
from pathlib import Path

from drivers.cia402.profile.machine import CONTROLWORD, PATTERNS, TRANSITIONS, Command, Transition, answer
from drivers.ports import DriveState


def _identifier(state: DriveState) -> str:
    return state.name


def _arrow(transition: Transition) -> str:
    commands = " or ".join(transition.commands)
    label = f"{transition.number}: {commands or 'by itself'}"
    if transition.note:
        label += f" ({transition.note})"
    source = "[*]" if transition.source is None else _identifier(transition.source)
    return f"    {source} --> {_identifier(transition.target)} : {label}"


def diagram() -> str:
    """The transitions as a mermaid state diagram."""
    names = [f'    state "{p.state}" as {_identifier(p.state)}' for p in PATTERNS]
    return "\n".join(["stateDiagram-v2", *names, *(_arrow(t) for t in TRANSITIONS)])


def _state_rows() -> list[str]:
    rows = ["| state | 6041 mask | value |", "|---|---|---|"]
    return rows + [f"| {p.state} | 0x{p.mask:02X} | 0x{p.value:02X} |" for p in PATTERNS]


def _answer_rows() -> list[str]:
    rows = ["| in state | " + " | ".join(Command) + " |", "|---|" + "---|" * len(Command)]
    rows.append("| *controlword* | " + " | ".join(f"0x{CONTROLWORD[c]:02X}" for c in Command) + " |")
    for pattern in PATTERNS:
        cells = [answer(pattern.state, command) or "-" for command in Command]
        rows.append(f"| {pattern.state} | " + " | ".join(cells) + " |")
    return rows


def page() -> str:
    """The whole page, as Markdown."""
    return "\n".join(
        [
            "# The CiA 402 drive machine",
            "",
            "Generated from `drivers/cia402/profile/machine.py` by `python -m docs.tools.cia402",
            "docs/cia402.md`; a test checks that it is current.",
            "",
            "```mermaid",
            diagram(),
            "```",
            "",
            "Arrow 13 leaves every state. Power-off (disable voltage) and quick stop are one single write from",
            "anywhere; a fault reset is a step of its own that somebody acknowledges, and it never enables.",
            "",
            "## Statusword",
            "",
            *_state_rows(),
            "",
            "## Where a command leads (- is ignored by the drive)",
            "",
            *_answer_rows(),
            "",
        ]
    )


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(page(), encoding="utf-8")
