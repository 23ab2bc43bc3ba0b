"""What went amiss in a run, as rows of a table: what was said over and over is one row with its count."""

import re
from collections.abc import Sequence

from fidim_lab.app.report.contents.story import Incident
from fidim_lab.app.report.sections.numerals import duration

OFTEN = 3
"""as many like it are told one by one"""
NUMBER = re.compile(r"\d+(\.\d+)?")


def incident_rows(incidents: Sequence[Incident]) -> list[tuple[Incident, str, str]]:
    """Each incident with when and what was said; more than three that differ only in numbers stand together."""
    alike: dict[tuple[str, ...], list[Incident]] = {}
    for one in incidents:
        alike.setdefault((one.what, one.outcome.value, NUMBER.sub("#", one.reason)), []).append(one)
    rows: list[tuple[Incident, str, str]] = []
    for group in alike.values():
        first = group[0]
        if len(group) <= OFTEN:
            rows += [(one, duration(one.t), one.reason) for one in group]
        else:
            when = f"{duration(first.t)} to {duration(group[-1].t)}"
            rows.append((first, when, f"{len(group)} times, first: {first.reason}"))
    return sorted(rows, key=lambda row: row[0].t)
