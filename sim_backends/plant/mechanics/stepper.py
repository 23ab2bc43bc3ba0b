"""The plant's functions compiled for CasADi's virtual machine, and Butcher's sixth-order Runge–Kutta step.

(The reference model is integrated with Dormand–Prince 5; no coefficient is shared.) Called through buffers: a step of a
four-cable robot costs tens of microseconds, a call through the usual interface would double that.
"""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from sim_backends.plant.mechanics.dynamics import Inputs, contact, derivative, energy
from sim_backends.plant.mechanics.kinematics import HAND_SIZE
from sim_backends.plant.mechanics.terms import DRY_RATE
from sim_backends.plant.world import World

NODES = (0.0, 1 / 3, 2 / 3, 1 / 3, 1 / 2, 1 / 2, 1.0)
STAGES = (
    (),
    (1 / 3,),
    (0.0, 2 / 3),
    (1 / 12, 1 / 3, -1 / 12),
    (-1 / 16, 9 / 8, -3 / 16, -3 / 8),
    (0.0, 9 / 8, -3 / 8, -3 / 4, 1 / 2),
    (9 / 44, -9 / 11, 63 / 44, 18 / 11, 0.0, -16 / 11),
)
WEIGHTS = (11 / 120, 0.0, 27 / 40, 27 / 40, -4 / 15, -4 / 15, 11 / 120)
"""J. C. Butcher, On Runge–Kutta processes of high order, J. Austral. Math. Soc. 4 (1964): seven stages, order six."""


USUAL_STEP = 5e-3
"""s; positions within 1e-7 m of the converged ones after 10 s of free motion with rigid cables"""
SWIVEL_RATE = 3.0
"""rad/s, more than a platform's swivels turn with: bristles bend and slip within `give` over this"""
SHORT = 0.5
"""m, a short free cable, for estimating how stiff a world is"""


class Buffered:
    """A CasADi function called in place: fill `inputs[i]`, call, read `outputs[i]`, both column by column."""

    def __init__(self, function: ca.Function) -> None:
        # CasADi's stub asks for a size that the wrapped call takes from the memory view.
        buffer: Any
        buffer, self._evaluate = function.buffer()
        self.inputs = [np.zeros(function.numel_in(i)) for i in range(function.n_in())]
        self.outputs = [np.zeros(function.numel_out(i)) for i in range(function.n_out())]
        for i, array in enumerate(self.inputs):
            buffer.set_arg(i, array.data)
        for i, array in enumerate(self.outputs):
            buffer.set_res(i, array.data)
        self._keep = (function, buffer)

    def __call__(self) -> None:
        """Evaluate."""
        self._evaluate()


def compile_step(world: World, *, with_hand: bool) -> Buffered:
    """x, now, lengths, rates, accelerations, active, hand, h → state and the rest of `dynamics.derivative`, after h.

    Without a hand its input is ignored, and the step a fifth cheaper.
    """
    symbols = Inputs.of(world)
    function = ca.Function("derivative", symbols.all(), ca.cse(list(derivative(world, symbols))))
    start = Inputs.of(world)
    hand = start.hand if with_hand else ca.SX.zeros(HAND_SIZE)
    h = ca.SX.sym("h")

    def at(elapsed: ca.SX, x: ca.SX) -> list[ca.SX]:
        now = start.now + elapsed * ca.DM([1.0, 1.0, 0.0])
        rates = start.rates + start.accelerations * elapsed
        lengths = start.lengths + (start.rates + rates) / 2 * elapsed
        return [x, now, lengths, rates, start.accelerations, start.active, hand]

    end = butcher6(lambda elapsed, x: function(*at(elapsed, x))[0], start.x, h)
    quaternion = end[3:7] / ca.norm_2(end[3:7])
    end = ca.vertcat(end[0:3], quaternion, end[7:])
    ends = [end, *function(*at(h, end))[1:]]
    return Buffered(ca.Function("step", [*start.all(), h], [ca.densify(part) for part in ends]))


def butcher6(slope: Callable[[ca.SX, ca.SX], ca.SX], x: ca.SX, h: ca.SX) -> ca.SX:
    """One step of length h of ẋ = slope(elapsed, x) from x."""
    slopes: list[ca.SX] = []
    for node, row in zip(NODES, STAGES, strict=True):
        reached = sum((a * k for a, k in zip(row, slopes, strict=True) if a), ca.SX.zeros(x.numel()))
        slopes.append(slope(node * h, x + h * reached))
    return x + h * sum((b * k for b, k in zip(WEIGHTS, slopes, strict=True) if b), ca.SX.zeros(x.numel()))


def compile_derivative(world: World) -> Buffered:
    """All inputs → what `dynamics.derivative` gives."""
    symbols = Inputs.of(world)
    return Buffered(ca.Function("derivative", symbols.all(), [ca.densify(part) for part in derivative(world, symbols)]))


def compile_contact(world: World) -> Buffered:
    """All inputs → what `dynamics.contact` gives."""
    symbols = Inputs.of(world)
    return Buffered(ca.Function("contact", symbols.all(), [ca.densify(part) for part in contact(world, symbols)]))


def compile_energy(world: World) -> Buffered:
    """All inputs → energy, J."""
    symbols = Inputs.of(world)
    return Buffered(ca.Function("energy", symbols.all(), [ca.densify(energy(world, symbols))]))


def longest_step(world: World) -> float:
    """A step (s) that is accurate and stable for this world: 5 ms for rigid cables, less where something is stiff.

    Stiff are stretching cables (at most 0.6 rad of their fastest oscillation a step) and dry friction, which is a
    strong damper near rest. Both are bounded from above with the lever of the farthest attachment.
    """
    inertia = world.mass * float(np.linalg.eigvalsh(world.body.inertia_about_com)[0])
    lever = max(float(np.linalg.norm(cable.a - world.body.com)) for cable in world.cables)
    mobility = 1.0 / world.mass + lever**2 / inertia
    spring = damper = turning = 0.0
    step, weight = USUAL_STEP, world.mass * float(np.linalg.norm(world.gravity))
    for effect in world.hidden:
        cables = world.n if effect.cable is None else 1
        match effect.id:
            case "cable-elasticity":
                spring += cables * (effect["k"] or effect["EA"] / SHORT)
                damper += cables * effect["c"]
            case "frame-compliance":
                spring += world.n * effect["k"]
                damper += world.n * effect["c"]
            case "winch-hold-compliance":
                spring += effect["k"]
                damper += effect["c"]
            case "swivel-friction" if effect["give"] > 0:
                spring += cables * effect["c"] / effect["give"] / SHORT**2
                step = min(step, effect["give"] / SWIVEL_RATE)
            case "swivel-friction":
                damper += cables * effect["c"] / DRY_RATE / SHORT**2
            case "swivel-damping":
                damper += cables * effect["c"] / SHORT**2
            case "pulley-friction":
                damper += cables * (effect["viscous"] + (effect["dry"] + effect["arm"] * weight) / DRY_RATE) / SHORT**2
            case "attachment-friction":
                turning += cables * (effect["viscous"] + effect["dry"] / DRY_RATE)
            case "marker-stalk" if effect["k"] > 0:
                step = min(step, 0.6 * float(np.sqrt(effect["k"])))
            case _:
                pass
    oscillation, decay = np.sqrt(spring * mobility), damper * mobility + turning / inertia
    return float(min(step, 0.6 / max(oscillation, 1e-9), 1.5 / max(decay, 1e-9)))
