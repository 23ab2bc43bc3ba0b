"""The simulated operator on a clock that lets the plant's time pass."""

import asyncio

import numpy as np
import pytest

from drivers.ports import Prompt, PromptKind
from fidim_lab.errors import SetupError
from sim_backends.hand import Habits, SimulatedHand
from sim_backends.plant.plant import Plant

LENGTHS = np.array([1.42, 1.40, 1.45, 1.47])
ASK = Prompt(PromptKind.DISPLACE_AND_RELEASE, "pull", displacement=(0.03, -0.02))


class PlantClock:
    """Sleeping lets the plant move, in ticks of a bus."""

    def __init__(self, plant: Plant) -> None:
        self.plant = plant
        self.seen: list[tuple[float, np.ndarray, bool]] = []

    def now(self) -> float:
        return self.plant.t

    async def sleep(self, seconds: float) -> None:
        end = self.plant.t + seconds
        while end - self.plant.t > 1e-9:
            self.plant.advance(min(self.plant.t + 0.01, end))
            law = self.plant.hand
            touching = law is not None and law.at(self.plant.t).any()
            self.seen.append((self.plant.t, self.plant.markers()[0], bool(touching)))


def _ask(world, prompt: Prompt, seed: int = 0, *, swinging: bool = False) -> tuple[PlantClock, str, np.ndarray]:
    plant = Plant(world)
    rest = plant.settle(LENGTHS)
    if swinging:
        plant.place(plant.rest(LENGTHS, displacement=np.array([0.03, 0.02])), LENGTHS)
    clock = PlantClock(plant)
    hand = SimulatedHand(plant, clock, np.random.default_rng(seed))
    return clock, asyncio.run(hand.answer(prompt)), rest.marker


def test_it_displaces_holds_still_and_lets_go(world_of):
    clock, answer, rest = _ask(world_of(), ASK)
    assert answer == "done"
    t = np.array([entry[0] for entry in clock.seen])
    away = np.array([entry[1] for entry in clock.seen]) - rest
    assert 2.0 < t[-1] < 8.0
    speed = np.linalg.norm(np.diff(away, axis=0), axis=1) / np.diff(t)
    held = (t[1:] > t[-1] - 0.35) & (t[1:] < t[-1] - 0.15)
    np.testing.assert_allclose(away[1:][held][:, :2].mean(axis=0), ASK.displacement, atol=4e-3)
    assert speed[held].max() < 2e-3
    assert clock.plant.slack == ()


def test_after_a_moment_of_light_touching_the_hand_is_gone(world_of):
    clock, _, _ = _ask(world_of(), ASK)
    asyncio.run(clock.sleep(0.6))
    touched = [t for t, _, touching in clock.seen if touching]
    assert touched[-1] < clock.plant.t - 0.1
    energy = clock.plant.energy()
    asyncio.run(clock.sleep(1.0))
    assert clock.plant.energy() == pytest.approx(energy, abs=1e-6)
    assert np.ptp([entry[1][0] for entry in clock.seen[-100:]]) > 0.02


def test_no_two_pulls_are_alike_but_the_same_seed_is(world_of):
    marks = []
    for seed in (1, 1, 2):
        clock, _, _ = _ask(world_of(), ASK, seed)
        marks.append((clock.plant.t, clock.plant.markers().tobytes()))
    assert marks[0] == marks[1]
    assert marks[0] != marks[2]


def test_it_steadies_a_swinging_platform(world_of):
    clock, answer, rest = _ask(world_of(), Prompt(PromptKind.STEADY, "steady", choices=("ok",)), swinging=True)
    assert answer == "ok"
    assert clock.plant.t < 12.0
    asyncio.run(clock.sleep(1.0))
    assert np.linalg.norm(np.ptp([entry[1] for entry in clock.seen[-100:]], axis=0)) < 2e-3
    assert np.linalg.norm(clock.plant.markers()[0] - rest) < 2e-3


def test_it_confirms_after_a_moment(world_of):
    clock, answer, _ = _ask(world_of(), Prompt(PromptKind.CONFIRM, "go on?", choices=("yes", "no")))
    assert answer == "yes"
    assert 0.0 < clock.plant.t < 1.0


def test_a_displacement_it_cannot_read_is_refused(world_of):
    with pytest.raises(SetupError, match="x and y in m"):
        _ask(world_of(), Prompt(PromptKind.DISPLACE_AND_RELEASE, "pull"))


def test_habits_can_be_changed(world_of):
    plant = Plant(world_of())
    plant.settle(LENGTHS)
    slow = SimulatedHand(plant, PlantClock(plant), np.random.default_rng(0), Habits(reaction=5.0))
    asyncio.run(slow.answer(Prompt(PromptKind.CONFIRM, "go on?")))
    assert plant.t > 3.0
