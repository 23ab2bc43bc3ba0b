"""Physics that no effect of the catalogue describes: ids that may be hidden, to see that they are called unknown.

They belong to many families (by place, rate, time, joint angle, attitude; one-sided, without force near the middle), so
that a tool that only knows one shape of "unknown" is found out. The forces are in `outside_terms`; the magnet,
`unknown` itself, is in `hidden` and `terms`.
"""

from collections.abc import Mapping

from sim_backends.plant.kinds import HiddenKind, Key, xyz

_PLACE = xyz("", (-0.08, -0.07, -0.7), "m", "its middle, from the middle of the entry points")

OUTSIDE: Mapping[str, HiddenKind] = {
    "unknown-gradient": HiddenKind(
        {"k": Key(1.0, "N/m", "saddle of force in x and y: no spring to any point"), **_PLACE}
    ),
    "unknown-rotor": HiddenKind(xyz("h", (0.0, 0.0, 0.02), "N m s", "spin of a fan inside the platform, body frame")),
    "unknown-knock": HiddenKind(
        {
            **xyz("f", (0.5, 0.3, 0.0), "N", "largest force at the centre of mass"),
            "period": Key(0.9, "s", "from knock to knock", low=0.0),
            "w": Key(0.03, "s", "half width of a knock", low=0.0),
        }
    ),
    "unknown-cubic": HiddenKind({"c": Key(3.0, "N s³/m³", "drag that grows with the third power of speed")}),
    "unknown-eddy": HiddenKind(
        {
            "c": Key(2.0, "N s/m", "drag where it is strongest: a copper plate"),
            **_PLACE,
            "w": Key(0.1, "m", "its width", low=0.0),
        }
    ),
    "unknown-ripple": HiddenKind(
        {
            "c": Key(0.01, "N m", "detent torque about each swivel axis"),
            "teeth": Key(40.0, "1", "detents in one turn"),
        }
    ),
    "unknown-gusts": HiddenKind(
        {
            "f": Key(0.1, "N", "rms of a force that changes all the time"),
            "seed": Key(1.0, "1", "which course of it", low=0.0),
        }
    ),
    "unknown-stop": HiddenKind(
        {
            "k": Key(50.0, "N/m", "of a soft stop that pushes back beyond its middle"),
            "about": Key(0.0, "rad", "the way it faces, from x towards y"),
            **_PLACE,
        }
    ),
    "unknown-slack": HiddenKind(
        {
            "k": Key(25.0, "N/m", "spring to its middle along each axis"),
            **_PLACE,
            "w": Key(0.04, "m", "way without force to each side", low=0.0),
        }
    ),
    "unknown-sail": HiddenKind(
        {
            "c": Key(1.0, "N s²/m²", "drag across a flat plate on the platform"),
            "about": Key(0.6, "rad", "the way it faces, body frame, from x towards y"),
        }
    ),
    "unknown-offset-drag": HiddenKind(
        {
            "c": Key(0.8, "N s²/m²", "drag of a thing that stands out from the platform"),
            **xyz("b", (0.15, 0.0, 0.1), "m", "its place, body frame"),
        }
    ),
    "unknown-power": HiddenKind(
        {
            "c": Key(0.1, "N (s/m)^p", "drag of this power of speed"),
            "p": Key(0.5, "1", "the power", low=0.0),
        }
    ),
    "unknown-lift": HiddenKind({"k": Key(1.0, "N s²/m", "force across speed and rotation, k ω × v")}),
    "unknown-dipole": HiddenKind(
        xyz("m", (0.02, 0.01, 0.03), "N m", "torque of a magnet in the platform across a field that points down north")
    ),
    "unknown-bath": HiddenKind(
        {
            "c": Key(3.0, "N s/m", "drag below a level"),
            "z": Key(-0.7, "m", "the level, from the middle of the entry points"),
        }
    ),
}
