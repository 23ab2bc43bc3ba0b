"""Inertia and weight that cables and swivels add at the attachments, by Lagrange's equations and CasADi's derivatives.

The kinetic energy of swivel rotors and straight cables depends on the attachment alone: ½ Ȧᵀ m(A) Ȧ. Lagrange gives the
force at A that it takes: m Ä + ṁ Ȧ − ½ ∂(Ȧᵀ m Ȧ)/∂A, and the cable's weight is the gradient of its potential.
"""

import casadi as ca

from fidim_lab.data.records import Cable
from sim_backends.plant.mechanics.pulley import tangent
from sim_backends.plant.world import World


def needs_attached(world: World) -> bool:
    """Whether anything is attached: without it the platform's own constant mass matrix is used."""
    return bool(world.effects("swivel-inertia", "cable-mass"))


def attached_function(world: World, cable: Cable) -> ca.Function:
    """(A − D, Ȧ) → mass (3, 3), bias (3), weight (3), potential of what one cable attaches."""
    c, velocity = ca.SX.sym("c", 3), ca.SX.sym("velocity", 3)
    bend = tangent(c, cable)
    rotor = sum(effect["J"] for effect in world.effects("swivel-inertia"))
    density = sum(effect["mu"] for effect in world.effects("cable-mass"))
    # A straight cable turns about B in the pulley's plane, and about the swivel axis, where B is r(1 − cos φ) away.
    near = cable.radius * (1 - ca.cos(bend.wrap))
    across = rotor / bend.lever**2 + density * bend.free * (near**2 + near * bend.lever + bend.lever**2) / (
        3 * bend.lever**2
    )
    mass = across * (bend.across @ bend.across.T) + density * bend.free / 3 * (bend.normal @ bend.normal.T)
    kinetic = 0.5 * ca.dot(velocity, mass @ velocity)
    bias = ca.jtimes(mass @ velocity, c, velocity) - ca.gradient(kinetic, c)
    potential = -density * ca.dot(ca.DM(world.gravity), _first_moment(c, cable))
    return ca.Function("attached", [c, velocity], [mass, bias, -ca.gradient(potential, c), potential])


def _first_moment(c: ca.SX, cable: Cable) -> ca.SX:
    """∫ (x − D) ds along the cable from D round the pulley to A, m²."""
    bend, r, z = tangent(c, cable), cable.radius, ca.DM(cable.z)
    wrapped = r**2 * ((bend.wrap - ca.sin(bend.wrap)) * bend.outward + (1 - ca.cos(bend.wrap)) * z)
    return wrapped + bend.free * (c - 0.5 * bend.free * bend.along)
