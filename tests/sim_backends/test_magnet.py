"""The simulated release's magnet: it holds what a hand brings to it, and lets go at once."""

import asyncio

import numpy as np
import pytest

from drivers.clock import LoopClock
from drivers.ports import Prompt, PromptKind
from fidim_lab.errors import SetupError
from sim_backends.hand import SimulatedHand
from sim_backends.jumping_loop import run
from sim_backends.laboratory import Laboratory
from sim_backends.plant.world import make_world

LENGTHS = np.array([1.35, 1.35, 1.45, 1.45])
HANG_IN = Prompt(PromptKind.HANG_IN, "Hang it in.", displacement=(-0.02, 0.03))
clock = LoopClock()


async def carried_out(robot, work):
    """`work` in a laboratory that somebody looks at a hundred times a second."""
    world = make_world(robot, np.random.default_rng(1), body=robot.nominal)
    laboratory = Laboratory(robot, world, LENGTHS, np.random.default_rng(2), clock.now)

    async def live():
        while True:
            laboratory.advance(clock.now())
            await clock.sleep(0.01)

    task = asyncio.ensure_future(live())
    try:
        return await work(laboratory)
    finally:
        task.cancel()


async def swing(laboratory, seconds):
    """Peak to peak of the marker (m), and its mean."""
    places = []
    for _ in range(round(seconds / 0.02)):
        places.append(laboratory.plant.markers()[0].copy())
        await clock.sleep(0.02)
    return float(np.ptp(places, axis=0).max()), np.mean(places, axis=0)


def test_it_holds_what_is_brought_and_lets_go(irma4):
    async def work(laboratory):
        rest = laboratory.plant.markers()[0].copy()
        laboratory.magnet.switch(True)
        assert await laboratory.hand(clock).answer(HANG_IN) == "done"
        await clock.sleep(1.0)
        held, place = await swing(laboratory, 1.0)
        laboratory.magnet.switch(False)
        free, _ = await swing(laboratory, 2.0)
        return held, place - rest, free

    held, aside, free = run(carried_out(irma4, work))
    assert held < 2e-3
    assert aside[:2] == pytest.approx([-0.02, 0.03], abs=6e-3)
    assert free > 0.03


def test_without_power_it_holds_nothing(irma4):
    async def work(laboratory):
        await laboratory.hand(clock).answer(HANG_IN)
        return (await swing(laboratory, 2.0))[0]

    assert run(carried_out(irma4, work)) > 0.03


def test_one_that_fetches_pulls_aside_by_itself(irma4):
    async def work(laboratory):
        rest = laboratory.plant.markers()[0].copy()
        laboratory.magnet.fetches = 0.05
        laboratory.magnet.switch(True)
        await clock.sleep(3.0)
        return (await swing(laboratory, 0.5))[1] - rest

    assert run(carried_out(irma4, work))[0] > 0.02


def test_a_laboratory_without_one_says_so(irma4):
    async def work(laboratory):
        hand = SimulatedHand(laboratory.plant, clock, np.random.default_rng(3))
        with pytest.raises(SetupError, match="has none"):
            await hand.answer(HANG_IN)

    run(carried_out(irma4, work))
