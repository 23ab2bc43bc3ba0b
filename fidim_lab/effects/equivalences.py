"""Effects that free motion cannot distinguish, known beforehand: equivalences with their reason and a remedy.

The information matrix finds these and more for the data at hand; this list says why, in words. `CONTAINED` and `GAUGE`
hold for any data of free motion with locked motors, however good; `NEAR` ones nearly (spec/findings.md: the share of
one effect's influence that the other explains).
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum


class Likeness(StrEnum):
    """How alike two effects are."""

    CONTAINED = "the first can do exactly what the others do, and more"
    NEAR = "they explain most of each other's influence"
    GAUGE = "free motion does not show it at all: states or body absorb it"


@dataclass(frozen=True)
class Equivalence:
    """A set of effects, by id, that stand for each other."""

    ids: tuple[str, ...]
    kind: Likeness
    why: str
    separate: str
    """what experiment separates them"""
    share: float | None = None
    """of one's influence that the other explains, where it was measured"""


EQUIVALENCES: tuple[Equivalence, ...] = (
    Equivalence(
        ("constant-force", "gravity-tilt"),
        Likeness.CONTAINED,
        "gravity turned by small angles is a steady horizontal force m g × angle at the centre of mass",
        "carry a known payload: a tilt's force grows with the mass, a draught's does not; or use a spirit level",
    ),
    Equivalence(
        ("constant-force", "clock-rate"),
        Likeness.CONTAINED,
        "free of friction, a clock fast by r shows motion under gravity g/(1 + r)²: an upward force of about 2 r m g; "
        "so do another gravity and mass added at the centre of mass",
        "compare the clocks over minutes, or excite what does not scale with gravity (friction, stretch)",
    ),
    Equivalence(
        ("constant-force", "body-force"),
        Likeness.NEAR,
        "a platform that stays upright hardly distinguishes a force fixed to it from one fixed to the room",
        "record windows at other headings, or with the fan switched off",
    ),
    Equivalence(
        ("cable-torsion", "lay-torque"),
        Likeness.NEAR,
        "a platform that keeps its heading hardly changes the torque of cables that were fixed twisted",
        "record windows at other headings, or with another payload: the torque of the lay grows with the tension",
    ),
    Equivalence(
        ("frame-sway", "periodic-force"),
        Likeness.NEAR,
        "a frame that moves by u pushes the platform with −m ü like a force; only what the cameras see of u itself "
        "differs, and not even that where they stand on the frame",
        "put a marker on the frame",
    ),
    Equivalence(
        ("cable-elasticity", "winch-hold-compliance"),
        Likeness.NEAR,
        "stretch of a cable and of its winch move the platform in the same way; the encoder shows the latter alone",
        "look at the encoders during the motion, or compare long cables with short ones",
    ),
    Equivalence(
        ("cable-elasticity", "frame-compliance"),
        Likeness.NEAR,
        "a cable that stretches and a post that bends move the platform alike; posts bend less under steep cables",
        "put a marker on a pulley, or compare equilibria under steep cables with those under flat ones",
    ),
    Equivalence(
        ("time-offset",),
        Likeness.GAUGE,
        "with locked motors every window's start state absorbs a shift of time; only what depends on absolute time "
        "(motor currents, creep, a periodic force in phase) shows it",
        "record motor currents, or a sync pulse",
    ),
    Equivalence(
        ("attachment-offset", "marker-offset"),
        Likeness.GAUGE,
        "all attachments, all markers and the centre of mass moved together in the body move nothing in the world: "
        "three of the parameters of all attachments together; six with the marker's offset",
        "measure one attachment against the marker",
    ),
    Equivalence(
        ("anchor-offset", "frame-misalignment"),
        Likeness.GAUGE,
        "all anchors moved or turned about the vertical together are the motion capture's frame moved the other way; "
        "with gravity-tilt about any axis",
        "measure one anchor in the motion capture's frame",
    ),
    Equivalence(
        ("anchor-offset", "capture-scale"),
        Likeness.NEAR,
        "all anchors, attachments and lengths a thousandth farther out are motion capture that measures a thousandth "
        "too short; only gravity, which sets the pace, does not grow with them",
        "measure the distance of two markers on a bar of known length",
    ),
    Equivalence(
        ("anchor-offset", "cable-length-bias"),
        Likeness.NEAR,
        "an anchor that moves along its cable is a longer cable",
        "record equilibria at which that cable has other directions",
        share=0.9995,
    ),
    Equivalence(
        ("anchor-offset", "pulley-radius"),
        Likeness.NEAR,
        "a larger pulley moves the point where its cable leaves",
        "record equilibria with other wrap angles",
        share=0.9995,
    ),
    Equivalence(
        ("rotational-drag", "swivel-damping"),
        Likeness.NEAR,
        "near one equilibrium the platform's rotation and that of the swivels are the same few freedoms",
        "record equilibria far apart, or turn a swivel by hand and time how long it takes to stop",
        share=0.97,
    ),
    Equivalence(
        ("swivel-friction", "swivel-damping"),
        Likeness.NEAR,
        "dry and viscous friction take the same energy at one amplitude",
        "record the decay of small and of large swings",
        share=0.946,
    ),
    Equivalence(
        ("attachment-friction", "swivel-friction"),
        Likeness.NEAR,
        "near one equilibrium cables turn in their attachments as their swivels turn: both take energy from rotation",
        "read swivel encoders: friction there makes a swivel lag behind its cable",
    ),
    Equivalence(
        ("attachment-friction", "rotational-drag", "rotational-drag-quadratic"),
        Likeness.NEAR,
        "all take energy from the platform's rotation; they differ in how this depends on rate and axis",
        "let the platform rotate about each body axis by itself, at two amplitudes: dry friction damps the small swing "
        "more, drag equally or less",
    ),
    Equivalence(
        ("air-drag-linear", "pulley-friction"),
        Likeness.NEAR,
        "near one equilibrium speed of the centre of mass and wrap rates are the same few freedoms",
        "record equilibria far apart",
        share=0.944,
    ),
    Equivalence(
        ("swivel-inertia", "cable-mass"),
        Likeness.NEAR,
        "the body's inertia absorbs inertia on the cables' angles, and gets wrong values",
        "record equilibria far apart: the body's inertia is the same everywhere, the swivels' lever is not",
    ),
)

GEOMETRY = "geometry of the robot file"
SHARED: Mapping[str, tuple[str, ...]] = {
    "dissipation of rotation": (
        "rotational-drag",
        "rotational-drag-quadratic",
        "swivel-friction",
        "swivel-damping",
        "pulley-friction",
        "attachment-friction",
    ),
    "dissipation": ("air-drag-linear", "air-drag-quadratic"),
    GEOMETRY: (
        "anchor-offset",
        "attachment-offset",
        "pulley-radius",
        "cable-length-bias",
        "marker-offset",
        "frame-misalignment",
        "capture-scale",
        "gravity-tilt",
    ),
    "a marker that is not where the robot file says": ("marker-offset", "marker-stalk"),
    "cables, winches or posts that yield": (
        "cable-elasticity",
        "winch-hold-compliance",
        "frame-compliance",
        "cable-creep",
    ),
    "mass in addition to the rigid body": ("swivel-inertia", "cable-mass", "loose-mass"),
    "an oscillation": ("periodic-force", "frame-sway"),
    "a force or torque other than gravity": (
        "constant-force",
        "body-force",
        "lay-torque",
        "cable-torsion",
        "umbilical",
    ),
    "clocks": ("clock-rate", "time-offset"),
}
"""what effects have in common: the name of a class whose members cannot be distinguished"""
WIDER: Mapping[str, tuple[str, ...]] = {
    "dissipation": ("dissipation of rotation", "dissipation"),
}
"""what several of these have in common"""


def held_by(id: str) -> tuple[str, ...]:
    """Effects of which one can do exactly what they do, so that no free motion ever proves it alone."""
    held = (one.ids[1:] for one in EQUIVALENCES if one.kind is Likeness.CONTAINED and one.ids[0] == id)
    return tuple(other for ids in held for other in ids)


def shared_by(ids: Iterable[str]) -> str | None:
    """What all of some effects have in common; None where that is nothing."""
    wanted = set(ids)
    for name, members in SHARED.items():
        if wanted <= set(members):
            return name
    for name, kinds in WIDER.items():
        if wanted <= {id for kind in kinds for id in SHARED[kind]}:
            return name
    return None
