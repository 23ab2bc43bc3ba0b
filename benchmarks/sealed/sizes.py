"""How large each effect is when it is hidden, and how a size becomes the keys of `--hide`.

The low ends are the faintest that are worth asking for, near the detection limits that the benchmark itself measures;
the high ends are what a laboratory may have without seeing it at once.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

Rng = np.random.Generator
Keys = Callable[[Rng, float], dict[str, float]]


@dataclass(frozen=True)
class Size:
    """How large an effect is hidden, and how that becomes its keys."""

    low: float
    """about what two minutes of recording with 0.1 mm of noise show on the paper's robot"""
    high: float
    """what a laboratory may have without seeing it at once"""
    unit: str
    keys: Keys
    one_cable: bool = False
    with_mass: bool = False
    """a force: grows with the robot's mass (11 kg: as given)"""


def _one(name: str) -> Keys:
    return lambda rng, size: {name: size}


def _vector(prefix: str, flat: float = 1.0) -> Keys:
    """A vector of this length in a random direction; `flat` < 1 lets z be smaller."""

    def keys(rng: Rng, size: float) -> dict[str, float]:
        direction = rng.normal(size=3) * np.array([1.0, 1.0, flat])
        return dict(zip((prefix + axis for axis in "xyz"), size * direction / np.linalg.norm(direction), strict=True))

    return keys


def _thrust(rng: Rng, size: float) -> dict[str, float]:
    """A force in the body's plane, and a torque about any axis."""
    return {**_vector("f", 0.3)(rng, size), **_vector("t")(rng, 0.1 * size)}


def _friction(rng: Rng, size: float) -> dict[str, float]:
    """Viscous, dry, or both: at 0.5 rad/s both are alike for one size."""
    parts = ((1.0, 0.0), (0.0, 1.0), (0.6, 0.6))[int(rng.integers(3))]
    return {"viscous": 2.0 * size * parts[0], "dry": size * parts[1]}


def _oscillating(rng: Rng, size: float) -> dict[str, float]:
    frequency = float(np.exp(rng.uniform(np.log(0.4), np.log(4.0))))
    return {**_vector("a", 0.3)(rng, size), "f": frequency, "psi": rng.uniform(-np.pi, np.pi)}


def _umbilical(rng: Rng, size: float) -> dict[str, float]:
    end = {"x": rng.uniform(-1, 1), "y": rng.uniform(-1, 1), "z": rng.uniform(0.0, 1.0)}
    rest = float(rng.choice([0.0, 0.5]))
    return {"k": size, "c": size * rng.uniform(0.0, 0.15), "rest": rest, **end, "bz": rng.uniform(0.0, 0.3)}


def _loose(rng: Rng, size: float) -> dict[str, float]:
    place = {f"b{axis}": value for axis, value in zip("xyz", rng.uniform(-0.1, 0.1, 3), strict=True)}
    return {"m": size, "f": rng.uniform(1.5, 6.0), "zeta": rng.uniform(0.01, 0.1), **place}


def _stalk(rng: Rng, size: float) -> dict[str, float]:
    """Upright but for some degrees."""
    lean = {f"e{axis}": value for axis, value in zip("xyz", [*rng.normal(0.0, 0.1, 2), 1.0], strict=True)}
    return {"k": size, "zeta": rng.uniform(0.02, 0.3), **lean}


def _tilt(rng: Rng, size: float) -> dict[str, float]:
    angle = rng.uniform(-np.pi, np.pi)
    return {"rx": size * np.cos(angle), "ry": size * np.sin(angle)}


def _misaligned(rng: Rng, size: float) -> dict[str, float]:
    shift = rng.uniform(0.0, 0.5)  # m for each radian
    return {**_vector("r")(rng, size), **_vector("d")(rng, size * shift)}


def _hand(rng: Rng, size: float) -> dict[str, float]:
    start = rng.uniform(1.0, 7.0)
    window = float(rng.choice([0, 1, 2, 3]))
    return {**_vector("f", 0.3)(rng, size), "start": start, "stop": start + rng.uniform(0.3, 2.0), "window": window}


def _fault(rng: Rng, size: float) -> dict[str, float]:
    """Outliers, frozen stretches or a jump, sometimes several."""
    which = rng.uniform(size=3) < 0.4
    which[int(rng.integers(3))] = True
    keys = {"outliers": float(np.exp(rng.uniform(np.log(0.002), np.log(0.03)))), "frozen": rng.uniform(0.05, 0.4)}
    keys = {name: value if on else 0.0 for (name, value), on in zip(keys.items(), which[:2], strict=True)}
    return {**keys, "size": size, "jump": 0.5 * size if which[2] else 0.0}


def _signed(name: str) -> Keys:
    return lambda rng, size: {name: size * float(rng.choice([-1.0, 1.0]))}


def _placed(name: str, width: tuple[float, float] | None = None) -> Keys:
    """A field about a place within the platform's reach."""

    def keys(rng: Rng, size: float) -> dict[str, float]:
        place = {"x": rng.uniform(-0.3, 0.3), "y": rng.uniform(-0.3, 0.3), "z": rng.uniform(-1.0, -0.5)}
        extent = {} if width is None else {"w": rng.uniform(*width)}
        return {name: size * float(rng.choice([-1.0, 1.0]) if name == "k" else 1.0), **place, **extent}

    return keys


def _facing(name: str, placed: Keys | None = None) -> Keys:
    """What faces some way in the horizontal plane, at a place where that matters."""

    def keys(rng: Rng, size: float) -> dict[str, float]:
        place = {} if placed is None else placed(rng, size)
        return {**place, name: size, "about": rng.uniform(-np.pi, np.pi)}

    return keys


def _twisted(rng: Rng, size: float) -> dict[str, float]:
    """Of cables that were fixed within 30° of the heading without twist, or of a hose from above."""
    if rng.random() < 0.5:
        return {"k": 0.0, "hose": size}
    return {"k": size, "p": size * rng.uniform(-0.5, 0.5)}


def _knock(rng: Rng, size: float) -> dict[str, float]:
    return {**_vector("f", 0.3)(rng, size), "period": rng.uniform(0.6, 2.5), "w": rng.uniform(0.02, 0.08)}


EFFECTS: Mapping[str, Size] = {
    "air-drag-linear": Size(0.01, 1.5, "N s/m", _one("c"), with_mass=True),
    "air-drag-quadratic": Size(0.03, 3.0, "N s²/m²", _one("c"), with_mass=True),
    "rotational-drag": Size(1e-3, 0.08, "N m s", _one("c"), with_mass=True),
    "rotational-drag-quadratic": Size(3e-3, 0.2, "N m s²", _one("c"), with_mass=True),
    "swivel-friction": Size(2e-4, 0.02, "N m", _one("c"), with_mass=True),
    "swivel-damping": Size(1e-3, 0.05, "N m s", _one("c"), with_mass=True),
    "swivel-inertia": Size(2e-3, 0.03, "kg m²", _one("J"), with_mass=True),
    "pulley-friction": Size(5e-4, 0.02, "N m (at 0.5 rad/s)", _friction, with_mass=True),
    "attachment-friction": Size(3e-4, 0.015, "N m (at 0.5 rad/s)", _friction, with_mass=True),
    "cable-elasticity": Size(3e-7, 2e-5, "1/N (1/EA)", lambda rng, size: {"EA": 1 / size, "c": rng.uniform(20, 80)}),
    "winch-hold-compliance": Size(
        5e-7, 2e-5, "m/N (1/k)", lambda rng, size: {"k": 1 / size, "c": rng.uniform(20, 80)}, one_cable=True
    ),
    "frame-compliance": Size(5e-7, 3e-5, "m/N (1/k)", lambda rng, size: {"k": 1 / size, "c": rng.uniform(20, 80)}),
    "cable-creep": Size(
        1e-4, 5e-3, "m", lambda rng, size: {**_signed("delta")(rng, size), "T": rng.uniform(1.0, 15.0)}, one_cable=True
    ),
    "cable-mass": Size(2e-3, 0.05, "kg/m", _one("mu"), with_mass=True),
    "lay-torque": Size(2e-5, 1e-3, "m", _signed("c")),
    "cable-torsion": Size(1e-3, 0.3, "N m² (or N m/rad)", _twisted, with_mass=True),
    "anchor-offset": Size(3e-4, 0.01, "m", _vector("d"), one_cable=True),
    "attachment-offset": Size(2e-4, 8e-3, "m", _vector("d"), one_cable=True),
    "pulley-radius": Size(3e-4, 5e-3, "m", _signed("dr")),
    "cable-length-bias": Size(5e-4, 0.01, "m", _signed("bias"), one_cable=True),
    "gravity-tilt": Size(5e-4, 0.02, "rad", _tilt),
    "marker-offset": Size(3e-4, 8e-3, "m", _vector("d")),
    "marker-stalk": Size(5e-6, 6e-4, "s² (1/(2π f)²)", _stalk),
    "frame-misalignment": Size(5e-4, 0.01, "rad", _misaligned),
    "capture-scale": Size(2e-4, 5e-3, "1", _signed("scale")),
    "clock-rate": Size(3e-5, 3e-3, "1", _signed("rate")),
    "time-offset": Size(1e-3, 0.03, "s", _signed("offset")),
    "periodic-force": Size(3e-3, 1.0, "N", _oscillating, with_mass=True),
    "constant-force": Size(0.01, 1.0, "N", _vector("f"), with_mass=True),
    "body-force": Size(0.01, 1.0, "N, and a tenth in N m", _thrust, with_mass=True),
    "umbilical": Size(0.05, 8.0, "N/m", _umbilical, with_mass=True),
    "loose-mass": Size(0.02, 0.5, "kg", _loose, with_mass=True),
    "frame-sway": Size(2e-5, 2e-3, "m", _oscillating),
    "hand-contact": Size(0.05, 3.0, "N", _hand, with_mass=True),
}
"""the catalogue, but sensor-fault and unknown, which stand alone"""

OUTSIDE: Mapping[str, Size] = {
    "unknown": Size(0.1, 4.0, "N", _placed("k", (0.1, 0.3)), with_mass=True),
    "unknown-gradient": Size(0.05, 4.0, "N/m", _placed("k"), with_mass=True),
    "unknown-rotor": Size(1e-3, 0.05, "N m s", _vector("h"), with_mass=True),
    "unknown-knock": Size(0.03, 3.0, "N", _knock, with_mass=True),
    "unknown-cubic": Size(0.2, 20.0, "N s³/m³", _one("c"), with_mass=True),
    "unknown-eddy": Size(0.2, 10.0, "N s/m", _placed("c", (0.06, 0.2)), with_mass=True),
    "unknown-ripple": Size(
        5e-4, 0.02, "N m", lambda rng, size: {"c": size, "teeth": float(rng.integers(20, 80))}, with_mass=True
    ),
    "unknown-gusts": Size(
        5e-3, 0.3, "N", lambda rng, size: {"f": size, "seed": float(rng.integers(1, 1000))}, with_mass=True
    ),
    "unknown-stop": Size(2.0, 100.0, "N/m", _facing("k", _placed("k")), with_mass=True),
    "unknown-slack": Size(1.0, 50.0, "N/m", _placed("k", (0.02, 0.08)), with_mass=True),
    "unknown-sail": Size(0.05, 3.0, "N s²/m²", _facing("c"), with_mass=True),
    "unknown-offset-drag": Size(
        0.05, 2.0, "N s²/m²", lambda rng, size: {"c": size, **_vector("b")(rng, 0.2)}, with_mass=True
    ),
    "unknown-power": Size(
        0.01, 0.3, "N (s/m)^p", lambda rng, size: {"c": size, "p": float(rng.choice([0.0, 0.5, 1.5]))}, with_mass=True
    ),
    "unknown-lift": Size(0.1, 5.0, "N s²/m", _signed("k"), with_mass=True),
    "unknown-dipole": Size(2e-3, 0.2, "N m", _vector("m"), with_mass=True),
    "unknown-bath": Size(
        0.2, 6.0, "N s/m", lambda rng, size: {"c": size, "z": rng.uniform(-0.75, -0.55)}, with_mass=True
    ),
}
SIZES: Mapping[str, Size] = {
    **EFFECTS,
    **OUTSIDE,
    "sensor-fault": Size(1.5e-3, 0.03, "m", _fault),
}
