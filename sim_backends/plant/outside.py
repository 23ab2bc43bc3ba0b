"""Physics that no effect of the catalogue describes: ids that may be hidden, to see that they are called unknown.

Each belongs to another family (by place, by rate, by time, by joint angle), so that a tool that only knows one shape of
"unknown" is found out. The forces are in `outside_terms`; the magnet, `unknown` itself, is in `hidden` and `terms`.
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
}
