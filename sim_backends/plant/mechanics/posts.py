"""Posts that bend sideways under the pull of the cable at their top; its pulley moves with them."""

from dataclasses import replace

import casadi as ca

from sim_backends.plant.hidden import HiddenEffect
from sim_backends.plant.mechanics.kinematics import Platform
from sim_backends.plant.mechanics.pulley import tangent
from sim_backends.plant.world import World


def soft_posts(world: World) -> tuple[HiddenEffect, ...]:
    """What lets posts bend."""
    return tuple(effect for effect in world.effects("frame-compliance") if effect["k"] > 0)


def on_bent_posts(body: Platform, tensions: ca.SX) -> Platform:
    """The platform with its cables where they are when posts bend under these tensions (n), N."""
    soft = sum(1 / effect["k"] for effect in soft_posts(body.world))
    if not soft:
        return body
    ends = []
    for i, (cable, end) in enumerate(zip(body.world.cables, body.cables, strict=True)):
        aside = soft * tensions[i] * ca.vertcat(end.tangent.along[:2], 0)
        moved = tangent(end.point.position - ca.DM(cable.d) - body.sway[0] - aside, cable)
        ends.append(replace(end, tangent=moved))
    return replace(body, cables=tuple(ends))
