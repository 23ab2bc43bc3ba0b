"""Options that several commands have, each said once."""

from collections.abc import Callable
from typing import Any

import click

from fidim_lab.app.cli.outputs import OUT_FILE

Option = Callable[[Callable[..., Any]], Callable[..., Any]]

EQUILIBRIA = click.option(
    "--equilibria", default=12, show_default=True, type=click.IntRange(1, 60), help="Number of equilibria."
)
LISTING = click.option(
    "--list", "listing", is_flag=True, help="Only print the steps and their times; no device is opened."
)
EMBEDDED = click.option(
    "--embedded", is_flag=True, help="Rehearse in real time on simulated devices in a child process."
)
PROCESSES = click.option("--processes", type=click.IntRange(1), help="Number of processes; default: one for each core.")
SCHEDULER = click.option(
    "--scheduler", metavar="ADDRESS", help="Address of a dask cluster to use instead of local processes."
)
YES = click.option("--yes", is_flag=True, help="Confirm that the load is secured, without being asked.")


def answer_option(kind: str, path: click.Path = OUT_FILE) -> Option:
    """`--json` of a command whose answer is a file of this kind."""
    return click.option("--json", "json_file", type=path, help=f'Write the answer as JSON ("{kind}").')


def seed_option(says: str = "Random seed.") -> Option:
    """`--seed` of what is simulated or searched."""
    return click.option("--seed", default=1, show_default=True, type=click.IntRange(0), help=says)


def held_out_option(usual: int, least: int = 0) -> Option:
    """`--validate`: how many windows are held out of a simulated campaign."""
    kind, says = click.IntRange(least, 60), "Number of held-out windows."
    return click.option("--validate", "validation", default=usual, show_default=True, type=kind, help=says)
