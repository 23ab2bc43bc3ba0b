"""Physics that a simulation may hide: the ids of the catalogue as frozen values, and the reader of `--hide`.

`parse_effect("anchor-offset:cable=4,dx=0.006")` gives a `HiddenEffect`; where each one enters is in `world` (geometry,
body, gravity), `terms` and `inertia` (forces), `dynamics` (stretch, sway, loose mass, stalk), `paid_out` (creep,
encoders) and `sensors` (what is measured). A parameter of 0 is "absent" for every effect; 0 for a stiffness is read as
rigid.

Every id of the catalogue is here. What is simplified:
- cable-mass: weight and inertia of the straight free cable and the weight of its wrap. The shortening by sag, of second
  order in the linear density, is left out, and so is the inertia of cable that runs while a winch travels.
- swivel-inertia: one rotor on each swivel axis; its gyroscopic couple on the frame does not reach the platform.
- frame-sway: the frame moves without turning, the cameras stand on the floor.
- cable-creep relaxes with the same time constant while its winch travels, so that every hold creeps again.
- hand-contact: one push of the shape sin² in each window, at the main marker.
- marker-stalk: a marker without mass of its own on the platform; its stalk does not get shorter.
- loose-mass: a point mass on an isotropic spring and damper, in addition to the platform's own mass.
- unknown: a smooth force field fixed in the room (a magnet), as one example of what no effect describes; more of them
  are in `outside`.

What goes wrong with readings over a session is in `session_kinds`.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fidim_lab.arrays import Vector3
from fidim_lab.data.files.toml_file import nearest
from fidim_lab.errors import SetupError
from sim_backends.plant.kinds import HiddenKind, Key, xyz
from sim_backends.plant.outside import OUTSIDE
from sim_backends.plant.session_kinds import SESSION

UNKNOWN = "unknown"
"""what an explanation calls physics that the catalogue does not have"""


@dataclass(frozen=True)
class HiddenEffect:
    """One effect with its size, as hidden in a simulated world."""

    id: str
    cable: int | None
    """1-based; None where it belongs to none or to all"""
    parameters: tuple[tuple[str, float], ...]

    def __getitem__(self, key: str) -> float:
        """The value of one parameter."""
        return dict(self.parameters)[key]

    def vector(self, *keys: str) -> Vector3:
        """Some parameters in a row."""
        values = dict(self.parameters)
        return np.array([values[key] for key in keys])

    @property
    def label(self) -> str:
        """What a perfect explanation calls it: physics outside the catalogue has no name but this."""
        return UNKNOWN if self.id in OUTSIDE else self.id

    def concerns(self, cable: int) -> bool:
        """Whether it acts on the cable with this 0-based index."""
        return self.cable is None or self.cable == cable + 1


_ABOUT = {
    "rx": Key(4e-3, "rad", "turned about x"),
    "ry": Key(-3e-3, "rad", "turned about y"),
    "rz": Key(5e-3, "rad", "turned about z"),
}
_OSCILLATION = {"f": Key(1.1, "Hz", "frequency"), "psi": Key(0.0, "rad", "phase")}

CATALOGUE: Mapping[str, HiddenKind] = {
    "air-drag-linear": HiddenKind({"c": Key(0.5, "N s/m", "drag at the centre of mass")}),
    "air-drag-quadratic": HiddenKind({"c": Key(1.0, "N s²/m²", "drag at the centre of mass")}),
    "rotational-drag": HiddenKind({"c": Key(0.04, "N m s", "drag of the rotation")}),
    "rotational-drag-quadratic": HiddenKind({"c": Key(0.1, "N m s²", "drag by the square of the rotation", low=0.0)}),
    "swivel-friction": HiddenKind(
        {
            "c": Key(0.007, "N m", "dry torque about each swivel axis", low=0.0),
            "give": Key(0.0, "rad", "turn over which it builds up; 0: at once", low=0.0),
        }
    ),
    "swivel-damping": HiddenKind({"c": Key(0.02, "N m s", "damping about each swivel axis")}),
    "swivel-inertia": HiddenKind({"J": Key(0.01, "kg m²", "inertia about each swivel axis")}),
    "pulley-friction": HiddenKind(
        {
            "viscous": Key(0.02, "N m s", "against the wrap rate"),
            "dry": Key(0.01, "N m", "against the wrap rate", low=0.0),
            "arm": Key(0.0, "m", "against the wrap rate, for each newton of tension", low=0.0),
        }
    ),
    "attachment-friction": HiddenKind(
        {"viscous": Key(0.01, "N m s", "at each attachment"), "dry": Key(0.01, "N m", "at each attachment", low=0.0)}
    ),
    "cable-elasticity": HiddenKind(
        {
            "EA": Key(2e5, "N", "stretch is ρ τ/EA", low=0.0),
            "k": Key(0.0, "N/m", "stiffness of a cable whatever its length, instead of EA where not 0", low=0.0),
            "c": Key(40.0, "N s/m", "damping of the stretch"),
        },
        any_cable=True,
    ),
    "winch-hold-compliance": HiddenKind(
        {"k": Key(1e5, "N/m", "of the held winch", low=0.0), "c": Key(40.0, "N s/m", "damping of the held winch")},
        one_cable=True,
    ),
    "frame-compliance": HiddenKind(
        {
            "k": Key(1e5, "N/m", "of each pulley's post, sideways", low=0.0),
            "c": Key(40.0, "N s/m", "damping along the cable"),
        }
    ),
    "cable-creep": HiddenKind(
        {"delta": Key(0.003, "m", "final creep"), "T": Key(5.0, "s", "time constant", low=0.0)}, one_cable=True
    ),
    "cable-mass": HiddenKind({"mu": Key(0.02, "kg/m", "linear density")}),
    "lay-torque": HiddenKind({"c": Key(2e-4, "m", "torque about each cable for each newton of its tension")}),
    "cable-torsion": HiddenKind(
        {
            "k": Key(0.05, "N m²", "torsional rigidity of each cable"),
            "p": Key(0.0, "N m² rad", "rigidity times the turn at which they are not twisted"),
            "hose": Key(0.0, "N m/rad", "stiffness of a hose from above", low=0.0),
        }
    ),
    "anchor-offset": HiddenKind(xyz("d", (0.005, -0.004, 0.003), "m", "true minus stated entry point"), one_cable=True),
    "attachment-offset": HiddenKind(
        xyz("d", (0.003, -0.002, 0.002), "m", "true minus stated attachment"), one_cable=True
    ),
    "pulley-radius": HiddenKind({"dr": Key(0.002, "m", "true minus stated radius")}),
    "cable-length-bias": HiddenKind({"bias": Key(0.005, "m", "encoder reading minus true length")}, one_cable=True),
    "gravity-tilt": HiddenKind({key: _ABOUT[key] for key in ("rx", "ry")}),
    "marker-offset": HiddenKind(xyz("d", (0.004, -0.003, 0.002), "m", "true minus stated place of the main marker")),
    "marker-stalk": HiddenKind(
        {
            "k": Key(2.5e-4, "s²", "way of the main marker for each m/s², 1/(2π f)² of its stalk", low=0.0),
            "zeta": Key(0.08, "1", "damping ratio", low=0.0),
            **xyz("e", (0.0, 0.0, 1.0), "1", "the stalk's direction, body frame, of any length; 0: soft all round"),
        }
    ),
    "frame-misalignment": HiddenKind(
        {**_ABOUT, **xyz("d", (0.002, -0.002, 0.001), "m", "shift of the measured points")}
    ),
    "capture-scale": HiddenKind({"scale": Key(2e-3, "1", "motion capture measures too long by this ratio")}),
    "clock-rate": HiddenKind({"rate": Key(1e-3, "1", "the cameras' clock runs faster by this ratio")}),
    "time-offset": HiddenKind({"offset": Key(0.01, "s", "the cameras see the platform later than their stamp says")}),
    "periodic-force": HiddenKind(
        {**xyz("a", (0.1, 0.4, 0.05), "N", "amplitude at the centre of mass"), **_OSCILLATION}
    ),
    "constant-force": HiddenKind(xyz("f", (0.3, -0.4, 0.0), "N", "at the centre of mass")),
    "body-force": HiddenKind(
        {
            **xyz("f", (0.3, 0.2, 0.0), "N", "at the centre of mass, body frame"),
            **xyz("t", (0.0, 0.0, 0.03), "N m", "torque, body frame"),
        }
    ),
    "umbilical": HiddenKind(
        {
            "k": Key(4.0, "N/m", "spring", low=0.0),
            "c": Key(0.3, "N s/m", "damper"),
            "rest": Key(0.0, "m", "length below which it is slack", low=0.0),
            **xyz("", (0.6, 0.5, 0.3), "m", "fixed end, from the middle of the entry points"),
            **xyz("b", (0.0, 0.0, 0.0), "m", "platform's end, body frame"),
        }
    ),
    "loose-mass": HiddenKind(
        {
            "m": Key(0.3, "kg", "loose mass"),
            "f": Key(2.6, "Hz", "its frequency on the held platform"),
            "zeta": Key(0.03, "1", "damping ratio", low=0.0),
            **xyz("b", (0.0, 0.0, 0.15), "m", "where it is held, body frame"),
        }
    ),
    "frame-sway": HiddenKind({**xyz("a", (1e-3, 5e-4, 0.0), "m", "amplitude"), **_OSCILLATION}),
    "hand-contact": HiddenKind(
        {
            **xyz("f", (1.0, -1.5, 0.0), "N", "largest force"),
            "start": Key(3.0, "s", "from the start of the window"),
            "stop": Key(4.0, "s", "from the start of the window"),
            "window": Key(0.0, "1", "number of the window in the order of recording; 0: all"),
        }
    ),
    "sensor-fault": HiddenKind(
        {
            "outliers": Key(0.01, "1", "share of marker samples that are off", low=0.0, high=1.0),
            "size": Key(0.01, "m", "standard deviation of an outlier", low=0.0),
            "frozen": Key(0.1, "s", "how long one run of samples repeats itself", low=0.0),
            "jump": Key(0.0, "m", "step of the main marker's x in the middle of a window"),
        }
    ),
    "unknown": HiddenKind(
        {
            "k": Key(-2.0, "N", "force of the field: k r/w exp(-r²/2w²)"),
            **xyz("", (-0.08, -0.07, -0.7), "m", "its middle, from the middle of the entry points"),
            "w": Key(0.15, "m", "its width", low=0.0),
        }
    ),
}

KNOWN: Mapping[str, HiddenKind] = {**CATALOGUE, **SESSION, **OUTSIDE}
"""all that can be hidden"""


def parse_effect(text: str, cables: int) -> HiddenEffect:
    """Read `EFFECT[:key=value,…]` for a robot of n cables.

    Raises:
        SetupError: for an id, key or value that the catalogue does not allow; the message lists what is.
    """
    name, _, rest = text.partition(":")
    kind = KNOWN.get(name.strip())
    if kind is None:
        near = nearest(name.strip(), KNOWN)
        meant = f"Did you mean {near}? " if near else ""
        raise SetupError(f"--hide {text}: no effect is called '{name}'.", hint=f"{meant}Known: {', '.join(KNOWN)}.")
    given = dict(_pair(text, part, kind) for part in rest.split(",") if part.strip())
    cable = _cable(text, given.pop("cable", None), kind, cables)
    values = {key: given.get(key, spec.default) for key, spec in kind.keys.items()}
    return HiddenEffect(name.strip(), cable, tuple(values.items()))


def _pair(text: str, part: str, kind: HiddenKind) -> tuple[str, float]:
    key, equals, value = (piece.strip() for piece in part.partition("="))
    known = [*(["cable"] if kind.one_cable or kind.any_cable else []), *kind.keys]
    if key in known and not value:
        raise SetupError(f"--hide {text}: the key {key} has no value.", hint=f"Write {key}=NUMBER.")
    if not equals or key not in known:
        raise SetupError(f"--hide {text}: '{part}' is not one of its keys.", hint=f"Allowed: {', '.join(known)}.")
    try:
        number = float(value)
    except ValueError:
        number = np.nan
    if not np.isfinite(number):
        raise SetupError(f"--hide {text}: {key} is '{value}', which is not a finite number.")
    spec = kind.keys.get(key)
    if spec is not None and not spec.lowest <= number <= spec.highest:
        bound = f"{spec.lowest:g} or more" if number < spec.lowest else f"{spec.highest:g} or less"
        says = f"{key} is {number:g} {spec.unit} ({spec.says}); {bound} can be meant."
        raise SetupError(f"--hide {text}: {says}")
    return key, number


def _cable(text: str, given: float | None, kind: HiddenKind, cables: int) -> int | None:
    if given is None:
        return 1 if kind.one_cable else None
    if given not in range(1, cables + 1):
        raise SetupError(f"--hide {text}: cable is {given:g}; this robot has cables 1 to {cables}.")
    return int(given)
