"""A page of docs from the figures of one run: tables in Markdown, with machine, date and commit above them."""

import os
import platform
import subprocess
import time
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGES = ROOT / "docs" / "benchmarks"
BUSY = 0.2
"""cores that others use: more is felt"""


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)


def provenance(command: str) -> str:
    """Who computed it, where and when."""
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True).stdout
    libraries = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "casadi"))
    when = datetime.now(UTC).date()
    return (
        f"`{command}`, {when}, commit {commit.strip() or 'unknown'}, {os.cpu_count()} cores ({platform.machine()}), "
        f"Python {platform.python_version()}, {libraries}."
    )


def write_section(page: str, title: str, command: str, text: str) -> None:
    """Put a section into docs/benchmarks/PAGE.md; one of the same title is replaced."""
    path = PAGES / f"{page}.md"
    PAGES.mkdir(parents=True, exist_ok=True)
    old = path.read_text(encoding="utf-8") if path.exists() else f"# Measured: {page}\n"
    head, *sections = old.rstrip().split("\n## ")
    kept = {section.split("\n", 1)[0]: section for section in sections}
    kept[title] = f"{title}\n{provenance(command)}\n\n{text.strip()}\n"
    path.write_text("\n\n## ".join([head.rstrip(), *(section.strip() for section in kept.values())]) + "\n", "utf-8")


def spent() -> tuple[float, float]:
    """Monotonic s, and CPU s that other processes than ours have used since the computer started (Linux)."""
    fields = [int(field) for field in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:]]
    idle = fields[3] + fields[4]
    ours = sum(os.times()[:4])
    return time.monotonic(), (sum(fields[:8]) - idle) / os.sysconf("SC_CLK_TCK") - ours


def meanwhile(before: tuple[float, float], *, idle: bool = False) -> str:
    """Who else used the computer since `before` (of `spent`), in sentences.

    A service that was killed counts as somebody else: nobody waited for it. idle: others are known to run at idle
    priority, but for short tests.
    """
    wall, others = (after - since for after, since in zip(spent(), before, strict=True))
    text = f"Meanwhile others used {others / wall:.1f} of {os.cpu_count()} cores."
    if idle:
        text += " They ran at idle priority (SCHED_IDLE), but for short tests: they had what this left."
    elif others > BUSY * wall:
        text += " Latencies, skipped cycles and CPU are those of a busy computer: measure again on an idle one."
    return f"{text} Priority (nice): {os.nice(0)}."
