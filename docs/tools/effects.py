"""The catalogue's table in docs/effects.md, from the code: `python -m docs.tools.effects docs/effects.md`."""

import sys
from pathlib import Path

import numpy as np

from fidim_lab.data.records import Body, Cable, Robot
from fidim_lab.effects.catalogue import catalogue
from fidim_lab.effects.effect import NamedEffect, Parameter
from fidim_lab.model.slots import Effect

BEGIN, END = "<!-- catalogue: begin -->", "<!-- catalogue: end -->"
SLOTS = (
    "geometry",
    "cable_length",
    "length_drift",
    "compliance",
    "wrench",
    "tension_wrench",
    "kinetic_energy",
    "extra_rates",
    "marker",
    "stalk",
    "seen",
    "true_time",
)


def slots_of(effect: NamedEffect) -> tuple[str, ...]:
    """The slots that an effect overrides."""
    return tuple(name for name in SLOTS if getattr(type(effect), name) is not getattr(Effect, name))


def table() -> str:
    """One row for each effect and variant."""
    rows = ["| id | what it is | for | slots | parameters: bounds (scale) |", "|---|---|---|---|---|"]
    kinds: dict[type[NamedEffect], list[NamedEffect]] = {}
    for effect in catalogue(_example()):
        kinds.setdefault(type(effect), []).append(effect)
    for alike in kinds.values():
        first = alike[0]
        name = f"`{first.id}`" + (f", {first.variant}" if first.variant else "")
        slots = ", ".join(slots_of(first)) or "none"
        parameters = "; ".join(_parameters(first)) or "none"
        rows.append(f"| {name} | {_cell(first.says)} | {_for(alike)} | {slots} | {_cell(parameters)} |")
    return "\n".join(rows)


def page(text: str) -> str:
    """The page with its table made anew."""
    before, rest = text.split(BEGIN)
    return f"{before}{BEGIN}\n{table()}\n{END}{rest.split(END)[1]}"


def _for(alike: list[NamedEffect]) -> str:
    cables = [effect.cable for effect in alike]
    if any(cables):
        return "all cables, or one" if None in cables else "one cable"
    return "the platform"


def _parameters(effect: NamedEffect) -> list[str]:
    """Names of parameters that are alike, with their bounds."""
    alike: dict[str, list[str]] = {}
    for parameter, scanned in zip(effect.parameters, effect.scanned, strict=True):
        alike.setdefault(_bounds(parameter, scanned), []).append(parameter.name)
    return [f"{', '.join(names)}: {bounds}" for bounds, names in alike.items()]


def _bounds(parameter: Parameter, scanned: bool) -> str:
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    end = ", scanned" if scanned else f" ({parameter.scale:g})"
    return f"{parameter.low:g}…{parameter.high:g}{unit}{end}"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _example() -> Robot:
    """Any robot with two cables: the table does not depend on it."""
    east, north, up = np.eye(3)
    cables = tuple(
        Cable(d=side * east + up, a=0.1 * side * east, radius=0.02, x=-up, y=north, z=east) for side in (-1.0, 1.0)
    )
    return Robot(cables, 1.0, Body(np.zeros(3), np.ones(6)), np.zeros(3))


if __name__ == "__main__":
    file = Path(sys.argv[1])
    file.write_text(page(file.read_text(encoding="utf-8")), encoding="utf-8")
