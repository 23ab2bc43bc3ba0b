"""What changes over a session: ids that may be hidden, named as an explanation names them.

length-drift    cables grow, unseen by their encoders, at a steady rate (`paid_out`)
length-step     one cable slips on its drum at some time (`paid_out`)
length-scatter  drums are eccentric: each stop of them is off by another amount (`paid_out`)
camera-drift    the frame of the motion capture moves at a steady rate (`sensors`)
body-step       a load is put on the platform at some time (`mechanics.loads`)
body-drift      a load on the platform grows at a steady rate (`mechanics.loads`)
"""

from collections.abc import Mapping

from sim_backends.plant.kinds import HiddenKind, Key, xyz

LOAD = xyz("", (0.05, -0.05, 0.1), "m", "from P to the load, body axes")

SESSION: Mapping[str, HiddenKind] = {
    "length-drift": HiddenKind({"rate": Key(3e-3, "m/h", "by which cables grow")}, any_cable=True),
    "length-step": HiddenKind(
        {"by": Key(5e-4, "m", "by which the cable is longer"), "at": Key(330.0, "s", "of the session", low=0.0)},
        one_cable=True,
    ),
    "length-scatter": HiddenKind(
        {
            "size": Key(2e-4, "m", "amplitude of a cable's length over one turn of its drum"),
            "radius": Key(0.05, "m", "of the drum", low=1e-3),
        },
        any_cable=True,
    ),
    "camera-drift": HiddenKind(xyz("", (2e-3, 0.0, -1e-3), "m/h", "by which measured points move")),
    "body-step": HiddenKind(
        {"m": Key(0.1, "kg", "of the load"), **LOAD, "at": Key(330.0, "s", "of the session", low=0.0)}
    ),
    "body-drift": HiddenKind({"rate": Key(0.5, "kg/h", "by which the load grows"), **LOAD}),
}
