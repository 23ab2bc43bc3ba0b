"""Effects as elements of MJCF: forces by actuators with an affine bias, drag by a sphere in a fluid, swivels by joints.

`TERMS` says which effects MJCF has an element for; all others would need a program beside the model.
"""

from collections.abc import Callable, Mapping
from xml.etree import ElementTree

import numpy as np

from fidim_lab.app.compose.multibody import numbers
from fidim_lab.arrays import Vector3
from fidim_lab.effects.cables.cable_mass import SwivelInertia
from fidim_lab.effects.dissipation.drag import (
    AirDragLinear,
    AirDragQuadratic,
    RotationalDrag,
    RotationalDragPerAxis,
    RotationalDragQuadratic,
)
from fidim_lab.effects.dissipation.pulley_friction import SwivelDamping, SwivelFriction
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.effects.loads.constant_force import BodyForce, ConstantForce
from fidim_lab.effects.loads.umbilical import Umbilical
from fidim_lab.effects.wrenches import DRY_RATE
from fidim_lab.errors import OurBugError

SPHERE = 0.05
"""m, radius of the sphere that feels quadratic drag; any will do, its coefficients are divided by it"""
THIN = 1e-9
"""kg/m³ of its fluid: so little that nothing else feels it, nor the sphere what it displaces"""

SOFT = 1e4
"""1/(kg m²), MuJoCo's regularisation of dry friction: its share of the acceleration then is small against that of the
rate; with a swivel as light as ours the least that MuJoCo allows"""


class MjcfModel:
    """The elements of a robot's MJCF, to which effects add theirs."""

    def __init__(self, text: str, com: Vector3, strength: float) -> None:
        """Of `multibody_mjcf`; com: from P, body axes, m; strength: a factor of all that is added."""
        self.root = ElementTree.fromstring(text)
        self.com = com
        self.strength = strength
        self._sites = 0

    @property
    def platform(self) -> ElementTree.Element:
        """The body that hangs."""
        return self._one("./worldbody/body[@name='platform']")

    def swivels(self, cable: int | None) -> list[ElementTree.Element]:
        """The hinges of one cable's pulley (1-based), or of all."""
        hinges = self.root.findall("./worldbody/body/joint[@type='hinge']")
        return hinges if cable is None else [hinges[cable - 1]]

    def site(self, place: np.ndarray) -> str:
        """A new site of the platform at a place in body axes, m; its name."""
        self._sites += 1
        name = f"force{self._sites}"
        ElementTree.SubElement(self.platform, "site", name=name, pos=numbers(place))
        return name

    def force(self, site: str, axis: int, *bias: float, world: bool) -> None:
        """bias[0] + bias[1] · length + bias[2] · its rate, along axis 0 to 2, or about it (3 to 5), in N or N m.

        In world axes with the length being the site's coordinate, or in the site's own, which are the body's.
        """
        place = self.root.find("actuator")
        if place is None:
            place = ElementTree.SubElement(self.root, "actuator")
        attributes = {"site": site, "gear": numbers(np.eye(6)[axis]), **({"refsite": "world"} if world else {})}
        attributes |= {"gainprm": "0", "biastype": "affine", "biasprm": numbers(self.strength * np.array(bias))}
        ElementTree.SubElement(place, "general", attributes)
        if world and self.root.find("./worldbody/site[@name='world']") is None:
            ElementTree.SubElement(self._one("worldbody"), "site", name="world", pos="0 0 0")

    def fluid(self, linear: float, rotational: float) -> None:
        """Force −linear ‖v‖ v at the centre of mass and torque −rotational ‖ω‖ ω, SI."""
        self._one("option").set("density", numbers(THIN))
        blunt = self.strength * linear / (THIN * np.pi * SPHERE**2)
        angular = self.strength * rotational / (THIN * 8 / 15 * np.pi * SPHERE**5)
        sphere = {"type": "sphere", "mass": "0", "pos": numbers(self.com), "size": numbers(SPHERE)}
        felt = {"fluidshape": "ellipsoid", "fluidcoef": numbers([blunt, 0, angular, 0, 0])}
        ElementTree.SubElement(self.platform, "geom", sphere | felt)

    def _one(self, path: str, within: ElementTree.Element | None = None) -> ElementTree.Element:
        found = (self.root if within is None else within).find(path)
        if found is None:
            raise OurBugError(f"The robot's MJCF has no {path}.")
        return found

    def text(self) -> str:
        """As a file holds it."""
        for swivel in self.root.findall("./worldbody/body"):
            hinge = swivel.find("joint[@frictionloss]")
            if hinge is None:
                continue
            own = self._one("inertial", swivel).get("diaginertia", "").split()[2]
            inertia = float(own) + float(hinge.get("armature", "0"))
            # MuJoCo has −(damping · rate + acceleration) / SOFT up to the loss; ours is loss · rate / DRY_RATE
            impedance = 1 / (1 + SOFT * inertia)
            damping = SOFT * float(hinge.get("frictionloss", "0")) / DRY_RATE
            hinge.set("solreffriction", numbers([-1, -damping * impedance]))
            hinge.set("solimpfriction", numbers([impedance, impedance, 1e-3]))
        ElementTree.indent(self.root)
        return ElementTree.tostring(self.root, encoding="unicode") + "\n"


def _drag(model: MjcfModel, effect: NamedEffect, theta: np.ndarray) -> None:
    site = model.site(model.com)
    for axis in range(3):  # alike in all directions, so body axes are as good as the world's
        model.force(site, axis, 0, 0, -theta[0], world=False)


def _rotational_drag(model: MjcfModel, effect: NamedEffect, theta: np.ndarray) -> None:
    site = model.site(model.com)
    for axis, c in enumerate(np.broadcast_to(theta, 3)):
        model.force(site, 3 + axis, 0, 0, -c, world=False)


def _constant_force(model: MjcfModel, effect: NamedEffect, theta: np.ndarray) -> None:
    site = model.site(model.com)
    for axis, newton in enumerate(theta):
        model.force(site, axis, newton, world=True)


def _body_force(model: MjcfModel, effect: NamedEffect, theta: np.ndarray) -> None:
    site = model.site(model.com)
    for axis, value in enumerate(theta):
        model.force(site, axis, value, world=False)


def _umbilical(model: MjcfModel, effect: NamedEffect, theta: np.ndarray) -> None:
    k, c = theta[:2]
    site = model.site(theta[5:])
    for axis, newton in enumerate(theta[2:5]):
        model.force(site, axis, newton, -k, -c, world=True)


def _on_swivels(attribute: str) -> Callable[[MjcfModel, NamedEffect, np.ndarray], None]:
    def add(model: MjcfModel, effect: NamedEffect, theta: np.ndarray) -> None:
        for hinge in model.swivels(effect.cable):
            hinge.set(attribute, numbers(float(hinge.get(attribute, "0")) + model.strength * theta[0]))

    return add


TERMS: Mapping[type[NamedEffect], Callable[[MjcfModel, NamedEffect, np.ndarray], None]] = {
    AirDragLinear: _drag,
    AirDragQuadratic: lambda model, effect, theta: model.fluid(theta[0], 0),
    RotationalDrag: _rotational_drag,
    RotationalDragPerAxis: _rotational_drag,
    RotationalDragQuadratic: lambda model, effect, theta: model.fluid(0, theta[0]),
    ConstantForce: _constant_force,
    BodyForce: _body_force,
    Umbilical: _umbilical,
    SwivelDamping: _on_swivels("damping"),
    SwivelFriction: _on_swivels("frictionloss"),
    SwivelInertia: _on_swivels("armature"),
}
"""how MJCF has each effect, θ in the order of its parameters"""
