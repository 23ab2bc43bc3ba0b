"""A cable robot as a MuJoCo model: swivelling pulleys as bodies, cables as tendons round cylinders, held by equalities.

What makes it work (found by trial, docs of MuJoCo are silent):
- MuJoCo's cylinder has no groove. Below about 134° of wrap the swivel would turn out of the cable's plane by itself, so
  each swivel is kept in it by two guide tendons, from 5 cm left and right of its axis to the attachment, held equal.
- A tendon wraps on the side of its side site, which must lie along the wrap, 60–160° from the entry; else the cable
  goes straight through the pulley, silently: whoever simulates checks lengths and wrap points.
- The cable begins 1 mm before D, or it would begin on the cylinder itself.
- Inextensible is an equality on the tendon with RK4 at 0.5 ms. A length limit switches by rounding.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from fidim_lab.arrays import Vector3
from fidim_lab.data.records import Cable, Pose
from sim_backends.plant.mechanics import loads_in, mass_of
from sim_backends.plant.world import World

STEP = 5e-4
"""s; with STIFF within 0.05 mm of the native plant over 10 s"""
BEFORE_ENTRY = 1e-3
"""m of each cable before its entry point D"""
SIDE_ANGLE = 1.9
"""rad along the wrap, where the side site stands"""
GUIDE = 0.05
"""m from the swivel axis to where a guide begins"""
STIFF = 'solref="0.0007 0.7" solimp="0.9999 0.99999 0.001"'
"""Faster than MuJoCo's `refsafe` allows at this step, yet stable with RK4. At refsafe's limit (0.001 1) positions are 4
times farther off; faster still (0.0005 1), tensions are 2 N off."""
SWIVEL = '<inertial pos="0 0 0" mass="1e-4" diaginertia="1e-8 1e-8 1e-8"/>'
"""as light as the engine's arithmetic allows: 1e-5 of the platform's inertia at a lever of 0.3 m"""


def multibody_xml(world: World, pose: Pose, t: float = 0.0) -> str:
    """The robot of a world, its nominal pose being this one of P; its tendons keep the lengths they have there.

    t: s of the session, at which its loads are what they are.

    Body `platform` (the first, with a free joint at P), tendon and equality i hold cable i; forces are not in it.
    """
    cables = list(enumerate(world.cables))
    attachments = "".join(f'<site name="a{i}" pos="{numbers(cable.a)}"/>' for i, cable in cables)
    swivels = "".join(_swivel(i, cable, pose.position + pose.rotation @ cable.a) for i, cable in cables)
    quaternion = Rotation.from_matrix(pose.rotation).as_quat(scalar_first=True)
    held = "".join(f'<tendon tendon1="cable{i}" polycoef="0 0 0 0 0" {STIFF}/>' for i, _ in cables)
    guides = "".join(f'<tendon tendon1="left{i}" tendon2="right{i}" polycoef="0 1 0 0 0" {STIFF}/>' for i, _ in cables)
    return f"""<mujoco>
  <option timestep="{STEP}" integrator="RK4" gravity="{numbers(world.gravity)}" tolerance="1e-12" iterations="100">
    <flag contact="disable" refsafe="disable"/></option>
  <compiler autolimits="false" balanceinertia="false"/>
  <worldbody>
    <body name="platform" pos="{numbers(pose.position)}" quat="{numbers(quaternion)}">
      <freejoint/>
      {_inertial(world, t)}
      {attachments}
    </body>
    {swivels}
  </worldbody>
  <tendon>{"".join(_cable(i, cable) for i, cable in cables)}{"".join(_guides(i) for i, _ in cables)}</tendon>
  <equality>{held}{guides}</equality>
</mujoco>"""


def _swivel(number: int, cable: Cable, attachment: Vector3) -> str:
    """A body at D that turns about z, its x axis towards the attachment."""
    c = attachment - cable.d
    u = c - (c @ cable.z) * cable.z
    u /= np.linalg.norm(u)
    return f"""
    <body name="swivel{number}" pos="{numbers(cable.d)}" xyaxes="{numbers(u)} {numbers(np.cross(cable.z, u))}">
      {SWIVEL}<joint type="hinge" axis="0 0 1"/>{_pulley(number, cable.radius)}
      <site name="left{number}" pos="0 {GUIDE} 0"/><site name="right{number}" pos="0 {-GUIDE} 0"/>
    </body>"""


def _pulley(number: int, r: float) -> str:
    if r == 0:
        return f'<site name="entry{number}" pos="0 0 0"/>'
    side = (r - 1.5 * r * np.cos(SIDE_ANGLE), 0.0, 1.5 * r * np.sin(SIDE_ANGLE))
    return (
        f'<geom name="pulley{number}" type="cylinder" size="{r:.17g} 0.02" pos="{r:.17g} 0 0" zaxis="0 1 0"/>'
        f'<site name="entry{number}" pos="0 0 {-BEFORE_ENTRY}"/><site name="side{number}" pos="{numbers(side)}"/>'
    )


def _cable(number: int, cable: Cable) -> str:
    wrap = f'<geom geom="pulley{number}" sidesite="side{number}"/>' if cable.radius else ""
    return f'<spatial name="cable{number}"><site site="entry{number}"/>{wrap}<site site="a{number}"/></spatial>'


def _guides(number: int) -> str:
    return "".join(
        f'<spatial name="{side}{number}"><site site="{side}{number}"/><site site="a{number}"/></spatial>'
        for side in ("left", "right")
    )


def _inertial(world: World, t: float) -> str:
    """The platform with its loads at t."""
    parts = [(world.mass, world.body.com, world.mass * world.body.inertia_about_com)]
    for load in loads_in(world):
        parts.append((float(mass_of(load, t)), load.vector("x", "y", "z"), np.zeros((3, 3))))
    mass = sum(part for part, _, _ in parts)
    com = sum(part * at for part, at, _ in parts) / mass
    inertia = np.zeros((3, 3))
    for part, at, own in parts:
        arm = at - com
        inertia += own + part * ((arm @ arm) * np.eye(3) - np.outer(arm, arm))
    six = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return f'<inertial pos="{numbers(com)}" mass="{mass:.17g}" fullinertia="{numbers(six)}"/>'


def numbers(values: object) -> str:
    """Floats as MJCF has them, to the bit."""
    return " ".join(f"{value:.17g}" for value in np.ravel(np.asarray(values, dtype=float)))
