"""Newton–Euler about G with cable constraints, as CasADi functions: tensions are the multipliers of the constraints.

    M v̇ + (Jᵀ − W) τ = f,  J v̇ = l̈ − (what the motion alone gives),  v = [velocity of G (world); spin (body)]

W is what goes with a tension beside its pull (friction, a rope that untwists); no part of an impact.

Rigid cables are held by multipliers with Baumgarte's stabilisation, elastic ones (cable-elasticity, a compliant winch)
pull with k (l − l₀) + c (l̇ − l̇₀) where that is positive. A cable that is not `active` pulls with nothing.

The hand pushes the marker, and steadies the platform with what else it takes to leave every tension as it is
(`gripped`): a push at the marker alone would slacken a cable long before an experiment's displacements are reached.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from sim_backends.plant.mechanics.inertia import attached_function, needs_attached
from sim_backends.plant.mechanics.kinematics import (
    HAND_SIZE,
    Platform,
    platform,
    quaternion_rate,
    size,
    stalks,
    sticking,
)
from sim_backends.plant.mechanics.loads import loaded, loads_in, loads_of
from sim_backends.plant.mechanics.posts import on_bent_posts, soft_posts
from sim_backends.plant.mechanics.pulley import Tangent, tangent
from sim_backends.plant.mechanics.terms import (
    applied,
    bending,
    hand_push,
    loose_acceleration,
    per_newton,
    stalk_acceleration,
    with_tension,
)
from sim_backends.plant.mechanics.wrench import Wrench
from sim_backends.plant.world import World

BAUMGARTE = 25.0
"""1/s: rate at which an error of length dies out; with it the drift over 10 s stays under 1e-8 m"""


@dataclass(frozen=True, eq=False)
class Inputs:
    """The symbols that every function of the plant takes, in this order."""

    x: ca.SX
    now: ca.SX
    """plant time, time in the window, number of the window"""
    lengths: ca.SX
    """(n,) true unstretched lengths, m"""
    rates: ca.SX
    accelerations: ca.SX
    active: ca.SX
    """(n,) 1 where the cable is taut, 0 where it is slack"""
    hand: ca.SX

    @staticmethod
    def of(world: World) -> "Inputs":
        """Fresh symbols for a world."""
        n = world.n
        sizes = (size(world), 3, n, n, n, n, HAND_SIZE)
        names = ("x", "now", "lengths", "rates", "accelerations", "active", "hand")
        return Inputs(*(ca.SX.sym(name, length) for name, length in zip(names, sizes, strict=True)))

    def all(self) -> list[ca.SX]:
        """In order."""
        return [self.x, self.now, self.lengths, self.rates, self.accelerations, self.active, self.hand]


@dataclass(frozen=True, eq=False)
class CableStretch:
    """How one cable gives way: `stiffness` is None where it does not."""

    stiffness: ca.SX | None
    damping: float


@dataclass(frozen=True, eq=False)
class Equations:
    """The motion's equations, about G, not yet solved."""

    mass: ca.SX
    """(6, 6)"""
    force: ca.SX
    """(6,) without hand and cables"""
    hand: ca.SX
    """(6,) of the hand's push alone"""
    jacobian: ca.SX
    """(n, 6) l̇ = J v (+ what the frame's sway gives)"""
    pulling: ca.SX
    """(6, n) Jᵀ − W"""
    lengths: ca.SX
    rates: ca.SX
    required: ca.SX
    """(n,) J v̇ that keeps the rigid cables' lengths"""
    elastic_tension: ca.SX
    """(n,) of the elastic cables, 0 for the rigid ones"""
    rigid: tuple[int, ...]
    platform: Platform


def stretch_of(world: World, i: int, bend: Tangent) -> CableStretch:
    """How cable i gives way: stiffnesses and dampers in series. A stiffness of 0 is a rigid cable."""
    compliance, yielding = ca.SX(0), 0.0
    for effect in world.effects("cable-elasticity", "winch-hold-compliance"):
        soft = effect["k"] > 0 or (effect.id == "cable-elasticity" and effect["EA"] > 0)
        if soft and effect.concerns(i):
            compliance = compliance + (1 / effect["k"] if effect["k"] > 0 else bend.free / effect["EA"])
            yielding += 1 / effect["c"] if effect["c"] > 0 else np.inf
    for effect in soft_posts(world):
        compliance = compliance + ca.sumsqr(bend.along[:2]) / effect["k"]
        yielding += 1 / effect["c"] if effect["c"] > 0 else np.inf
    return CableStretch(None, 0.0) if yielding == 0.0 else CableStretch(1 / compliance, 1 / yielding)


def equations(world: World, symbols: Inputs) -> Equations:
    """Newton–Euler of the platform with its cables, in a general state."""
    body = platform(world, symbols.x, symbols.now)
    mass, force = mass_and_force(body)
    rows, lengths, rates, required, elastic = [], [], [], [], []
    rigid: list[int] = []
    for i, end in enumerate(body.cables):
        bend = end.tangent
        row = row_of(body, i)
        length, rate = bend.length, ca.dot(bend.along, end.velocity)
        beyond, faster = length - symbols.lengths[i], rate - symbols.rates[i]
        stretch = stretch_of(world, i, bend)
        if stretch.stiffness is None:
            rigid.append(i)
            elastic.append(ca.SX(0))
        else:
            pull = ca.fmax(stretch.stiffness * beyond + stretch.damping * faster, 0) * (beyond > 0)
            elastic.append(pull)
        moving = ca.dot(bend.along, end.point.centripetal - body.sway[2]) + bend.curvature(end.velocity)
        stabilised = symbols.accelerations[i] - 2 * BAUMGARTE * faster - BAUMGARTE**2 * beyond
        rows.append(row)
        lengths.append(length)
        rates.append(rate)
        required.append(stabilised - moving)
    return Equations(
        mass=mass,
        force=force,
        hand=generalised(body, hand_push(body, symbols.hand)),
        jacobian=ca.vertcat(*rows),
        pulling=pulling(on_bent_posts(body, ca.vertcat(*elastic))),
        lengths=ca.vertcat(*lengths),
        rates=ca.vertcat(*rates),
        required=ca.vertcat(*required),
        elastic_tension=ca.vertcat(*elastic),
        rigid=tuple(rigid),
        platform=body,
    )


def row_of(body: Platform, i: int) -> ca.SX:
    """Row of J of cable i: velocity of G in the world frame, spin in the body frame."""
    end = body.cables[i]
    along = end.tangent.along
    return ca.horzcat(along.T, (body.rotation.T @ ca.cross(end.point.arm, along)).T)


def pulling(body: Platform) -> ca.SX:
    """Jᵀ − W (6, n): minus the force of each cable on [velocity of G; spin] for 1 N of its tension."""
    columns: list[ca.SX] = []
    for i, end in enumerate(body.cables):
        effects = [effect for effect in with_tension(body.world) if effect.concerns(i)]
        columns.append(row_of(body, i).T - generalised(body, per_newton(end, effects)))
    return ca.horzcat(*columns)


def generalised(body: Platform, wrench: Wrench) -> ca.SX:
    """A wrench about G as a force on [velocity of G (world); spin (body)]."""
    return ca.vertcat(wrench.force, body.rotation.T @ wrench.moment)


def gripped(inverse: ca.SX, jacobian: ca.SX, push: ca.SX) -> ca.SX:
    """A push on the platform, less what it would change in the cables' tensions: M P M⁻¹ push, J M⁻¹ result = 0."""
    spread = inverse @ jacobian.T
    return push - jacobian.T @ solve_spd(jacobian @ spread, spread.T @ push)


def derivative(world: World, symbols: Inputs) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """State derivative; for each cable tension (N), length beyond the given one (m), and rate beyond it (m/s)."""
    eq = equations(world, symbols)
    inverse, free = _free_motion(world, eq)
    tension, motion = eq.elastic_tension, free
    if eq.rigid:
        rigid = list(eq.rigid)
        j, active = eq.jacobian[rigid, :], symbols.active[rigid]
        spread = inverse @ eq.pulling[:, rigid]
        mask = ca.diag(active)
        condensed = mask @ (j @ spread) @ mask + ca.diag(1 - active)
        solve = ca.solve if with_tension(world) else solve_spd
        multipliers = solve(condensed, active * (j @ free - eq.required[rigid]))
        motion = free - spread @ multipliers
        tension = _scatter(tension, rigid, multipliers)
    rates = [eq.platform.velocity, quaternion_rate(symbols.x[3:7], eq.platform.spin), motion]
    effects = world.effects("loose-mass")
    for effect, (_, velocity) in zip(effects, eq.platform.loose, strict=True):
        _, pulled = loose_acceleration(eq.platform, effect)
        rates += [velocity, pulled + ca.DM(world.gravity)]
    for k, effect in enumerate(stalks(world)):
        rates += [eq.platform.stalks[k][1], stalk_acceleration(eq.platform, effect, k) + ca.DM(world.gravity)]
    rates += [bending(eq.platform, effect, k) for k, effect in enumerate(sticking(world))]
    return ca.vertcat(*rates), tension, eq.lengths - symbols.lengths, eq.rates - symbols.rates


def contact(world: World, symbols: Inputs) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX, ca.SX]:
    """What decides which of the m rigid cables pull.

    M⁻¹ Jᵀ (6, m); J M⁻¹ Jᵀ (m, m); then (m,) each: J v̇ of the free platform − required, l̇ − l̇₀, l − l₀.
    """
    eq = equations(world, symbols)
    inverse, free = _free_motion(world, eq)
    rigid = list(eq.rigid)
    j = eq.jacobian[rigid, :]
    spread = inverse @ j.T
    excess, faster, beyond = j @ free - eq.required[rigid], eq.rates - symbols.rates, eq.lengths - symbols.lengths
    return spread, j @ spread, excess, faster[rigid], beyond[rigid]


def rigid_cables(world: World) -> tuple[int, ...]:
    """Which cables are held by multipliers."""
    anywhere = (tangent(ca.SX(cable.x + cable.y + cable.z), cable) for cable in world.cables)
    return tuple(i for i, bend in enumerate(anywhere) if stretch_of(world, i, bend).stiffness is None)


def energy(world: World, symbols: Inputs) -> ca.SX:
    """Kinetic and potential energy of platform, attached masses, stretched cables, hoses and loose masses, J."""
    body = platform(world, symbols.x, symbols.now)
    mass, _ = mass_and_force(body)
    twist = ca.vertcat(body.velocity, body.spin)
    total = ca.dot(twist, mass @ twist) / 2 - world.mass * ca.dot(ca.DM(world.gravity), body.centre)
    for i, end in enumerate(body.cables):
        stretch = stretch_of(world, i, end.tangent)
        if stretch.stiffness is not None:
            total += stretch.stiffness * ca.fmax(end.tangent.length - symbols.lengths[i], 0) ** 2 / 2
        if needs_attached(world):
            cable = world.cables[i]
            total += attached_function(world, cable)(end.point.position - ca.DM(cable.d), end.velocity)[3]
    for load, point in loads_of(body):  # its speed is in the mass matrix
        total -= load * ca.dot(ca.DM(world.gravity), point.position)
    for effect in world.effects("umbilical"):
        reach = body.point(effect.vector("bx", "by", "bz")).position
        length = ca.norm_2(reach - ca.DM(effect.vector("x", "y", "z") + world.middle))
        total += effect["k"] * ca.fmax(length - effect["rest"], 0) ** 2 / 2
    for effect, (position, velocity) in zip(world.effects("loose-mass"), body.loose, strict=True):
        away = position - body.point(effect.vector("bx", "by", "bz")).position
        spring = (2 * np.pi * effect["f"]) ** 2 * ca.dot(away, away) / 2
        own = ca.dot(velocity, velocity) / 2 + spring - ca.dot(ca.DM(world.gravity), position)
        total += effect["m"] * own
    return total


def solve_spd(matrix: ca.SX, right: ca.SX) -> ca.SX:
    """Solve a symmetric positive definite system by LDLᵀ without pivoting."""
    diagonal, upper, order = ca.ldl(matrix, False)
    return ca.ldl_solve(right, diagonal, upper, order)


def mass_and_force(body: Platform) -> tuple[ca.SX, ca.SX]:
    """M and the force on [velocity of G; spin] without hand and tensions; attached inertia is included."""
    world = body.world
    inertia = ca.DM(world.mass * world.body.inertia_about_com)
    gyroscopic = ca.vertcat(ca.SX.zeros(3), ca.cross(body.spin, inertia @ body.spin))
    mass = ca.diagcat(world.mass * ca.SX.eye(3), inertia)
    force = generalised(body, applied(body)) - gyroscopic
    if needs_attached(world):
        for cable, end in zip(world.cables, body.cables, strict=True):
            attached = attached_function(world, cable)(end.point.position - ca.DM(cable.d) - body.sway[0], end.velocity)
            lever = ca.horzcat(ca.SX.eye(3), -ca.skew(end.point.arm) @ body.rotation)
            takes = attached[0] @ (end.point.centripetal - body.sway[2]) + attached[1]
            mass = mass + lever.T @ attached[0] @ lever
            force = force + lever.T @ (attached[2] - takes)
    return loaded(body, mass, force)


def inverse_of(world: World, mass: ca.SX) -> ca.SX:
    """M⁻¹; without attached inertia and loads M is constant and its inverse a number."""
    if needs_attached(world) or loads_in(world):
        return solve_spd(mass, ca.SX.eye(6))
    inertia = world.mass * world.body.inertia_about_com
    return ca.SX(ca.diagcat(ca.DM.eye(3) / world.mass, ca.DM(np.linalg.inv(inertia))))


def _free_motion(world: World, eq: Equations) -> tuple[ca.SX, ca.SX]:
    """M⁻¹, and the acceleration without the tension of rigid cables."""
    inverse = inverse_of(world, eq.mass)
    force = eq.force + gripped(inverse, eq.jacobian, eq.hand) - eq.pulling @ eq.elastic_tension
    return inverse, inverse @ force


def _scatter(values: ca.SX, at: list[int], new: ca.SX) -> ca.SX:
    parts = [values[i] for i in range(values.numel())]
    for k, i in enumerate(at):
        parts[i] = new[k]
    return ca.vertcat(*parts)
