"""Opening the rig of a service: what the rig file names, or the same simulated in a child process.

Prompts are not answered here: what is opened has the hand that does what is asked, where there is a simulated one.
"""

import contextlib
from collections.abc import AsyncGenerator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace

import numpy as np

from drivers.canbus.transport import CanFrame
from drivers.cia402.dictionary import WinchConfig
from drivers.ports import Operator, Prompt, Rig
from drivers.remote_operator import RemoteOperator
from fidim_lab.app import compose
from fidim_lab.app.formats.run_spec import RunSpec
from fidim_lab.data.records import Plan
from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.errors import OurBugError
from procedures.steps import Lengths


@dataclass(frozen=True, eq=False)
class Opened:
    """A rig that is open, and what a service needs besides."""

    rig: Rig
    """its operator is not to be asked: the service has its own"""
    hand: Operator | None
    """does what prompts ask for, in simulations"""
    tap: Callable[[Callable[[CanFrame], None]], None]
    """call a listener for each frame on the bus"""
    bitrate: float
    """bit/s; 0 where nothing limits it"""


HOMING = "home"
"""the procedure that makes encoders' zeros anew"""


class _Nobody:
    """Is never asked."""

    async def answer(self, prompt: Prompt) -> str:
        raise OurBugError(f"A prompt was not given to the clients: {prompt.text}")


@asynccontextmanager
async def open_rig(
    spec: RunSpec, file: RigFile, winches: Sequence[WinchConfig], plan: Plan, start: Lengths | None = None
) -> AsyncGenerator[Opened]:
    """Open it until the context ends. Raises SetupError, DeviceError, BusError as `compose` does.

    winches: what the drivers are told of those of `file`; a rehearsal has the same. start: where an embedded robot
    rests, m; else at the plan's first lengths.
    """
    async with contextlib.AsyncExitStack() as stack:
        if spec.embedded:
            where = plan if start is None else _resting_at(plan, start)
            devices = compose.embedded_devices(file, where, spec.seed, spec.hide, loaded=not spec.by)
            file = await stack.enter_async_context(devices)
        hand: RemoteOperator | None = None
        if file.hand is not None:
            hand = RemoteOperator(file.hand.host, file.hand.port)
            await hand.open()
            stack.push_async_callback(hand.close)
        real = await stack.enter_async_context(
            compose.real_rig(file, _Nobody(), winches=winches, takes_over=spec.resume, tried_by=spec.by)
        )
        yield Opened(real.rig, hand, real.transport.tap, float(file.bus.bitrate))


def _resting_at(plan: Plan, start: Lengths) -> Plan:
    """A plan of one window at these lengths: a simulated laboratory begins at the first ones."""
    return replace(plan, windows=(replace(plan.windows[0], lengths=np.array(start)),))
