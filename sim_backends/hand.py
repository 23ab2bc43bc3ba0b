"""The operator of a dry run: a simulated hand that displaces and releases the platform, steadies it, answers prompts.

It knows the plant and a clock, nothing of the procedure. Somebody else (the simulated drives) lets plant time pass.
"""

from dataclasses import dataclass

import numpy as np

from drivers.ports import Clock, Prompt, PromptKind
from fidim_lab.arrays import Vector3
from fidim_lab.errors import SetupError
from sim_backends.magnet import SimulatedMagnet
from sim_backends.plant.plant import HandLaw, Plant

LOOK = 0.02
"""s between two looks at the platform"""
STILL = 1e-3
"""m/s of the marker below which the hand takes the platform for still"""
GRIP = 2.5
"""Hz, natural frequency of the platform's mass in the hand's grip"""


@dataclass(frozen=True)
class Habits:
    """How somebody works: times in s, each drawn anew within ±30 %."""

    reaction: float = 0.5
    moving: float = 1.8
    holding: float = 1.0
    letting_go: float = 0.05
    lingering: float = 0.3
    """light touching after letting go; the answer comes when it begins"""
    carelessness: float = 0.001
    """m, standard deviation of the displacement reached, in x and y"""
    patience: float = 10.0
    """at most so long for waiting until the platform is still"""


class SimulatedHand:
    """`Operator` that does what is asked and takes the first choice, as a person with some skill would.

    Not simulated: a hand that slips, grips beside the marker, or gets in the way of the cameras; refusing or skipping.
    """

    def __init__(
        self,
        plant: Plant,
        clock: Clock,
        rng: np.random.Generator,
        habits: Habits | None = None,
        magnet: SimulatedMagnet | None = None,
    ) -> None:
        """magnet: of a release device, to which it brings the platform when asked to."""
        self._plant = plant
        self._magnet = magnet
        self._clock = clock
        self._rng = rng
        self._habits = habits or Habits()
        mass, w = plant.world.mass, 2 * np.pi * GRIP
        self._stiffness = mass * w**2 * np.array([1.0, 1.0, 0.0])
        self._damping = 2 * 0.8 * mass * w * np.array([1.0, 1.0, 0.0])

    async def answer(self, prompt: Prompt) -> str:
        """Do it, and give the prompt's first choice.

        Raises:
            SetupError: a displacement that is not two numbers; no magnet to bring the platform to.
            InfeasibleError: the platform does not rest with these cable lengths.
        """
        await self._clock.sleep(self._about(self._habits.reaction))
        match prompt.kind:
            case PromptKind.DISPLACE_AND_RELEASE:
                await self._displace_and_release(np.array(prompt.displacement, dtype=float))
            case PromptKind.HANG_IN:
                await self._hang_in(np.array(prompt.displacement, dtype=float))
            case PromptKind.STEADY:
                await self._steady()
            case PromptKind.CONFIRM:
                pass
        return prompt.choices[0]

    async def _displace_and_release(self, displacement: np.ndarray) -> None:
        await self._let_go(await self._displace(displacement))

    async def _hang_in(self, displacement: np.ndarray) -> None:
        """Bring it to the magnet, and step back; where the magnet has no power, the platform swings free."""
        if self._magnet is None:
            raise SetupError("A prompt asks for the release device, but the simulated laboratory has none.")
        held = await self._displace(displacement)
        if not self._magnet.take(held, self._stiffness):
            await self._let_go(held)

    async def _displace(self, displacement: np.ndarray) -> Vector3:
        """Displace and hold; gives the target of the hand's spring by then."""
        if displacement.shape != (2,) or not np.isfinite(displacement).all():
            raise SetupError(f"A prompt asks for the displacement {displacement.tolist()}; it must be x and y in m.")
        plant, habits = self._plant, self._habits
        rest = plant.rest(plant.encoder_lengths(), near=plant.pose).marker
        wanted = rest.copy()
        wanted[:2] += displacement + self._rng.normal(0.0, habits.carelessness, 2)
        await self._move(plant.markers()[0], wanted, self._about(habits.moving))
        return await self._hold(wanted, self._about(habits.holding))

    async def _move(self, start: Vector3, wanted: Vector3, duration: float) -> None:
        """Along a path of least jerk, as human arms do (Flash and Hogan 1985)."""
        for u in np.linspace(0.0, 1.0, max(2, round(duration / LOOK)) + 1)[1:]:
            part = u**3 * (10 - 15 * u + 6 * u**2)
            self._plant.hand = self._law(start + part * (wanted - start))
            await self._clock.sleep(LOOK)

    async def _hold(self, wanted: Vector3, duration: float) -> Vector3:
        """Bring the marker there and keep it still; gives the target by then, which leads the marker a little."""
        target, moved, waited = wanted.copy(), np.inf, 0.0
        before = self._plant.markers()[0]
        while waited < duration or (moved > STILL and waited < self._habits.patience):
            error = wanted - before
            target[:2] += 3.0 * LOOK * error[:2]
            self._plant.hand = self._law(target)
            await self._clock.sleep(LOOK)
            now = self._plant.markers()[0]
            moved, before = float(np.linalg.norm(now - before)) / LOOK, now
            waited += LOOK
        return target

    async def _let_go(self, target: Vector3) -> None:
        plant, gone = self._plant, self._about(self._habits.letting_go)
        plant.hand = self._law(target, fading=plant.t, until=plant.t + gone)
        plant.begin_window()
        await self._clock.sleep(gone)
        lingering = self._about(self._habits.lingering)
        plant.hand = HandLaw(
            target=target,
            stiffness=np.zeros(3),
            damping=np.full(3, 0.5),
            force=np.append(self._rng.normal(0.0, 0.1, 2), 0.0),
            fading=plant.t,
            until=plant.t + lingering,
        )

    async def _steady(self) -> None:
        """Damp the swing until the platform is still."""
        waited, moved = 0.0, np.inf
        before = self._plant.markers()[0]
        while waited < self._about(0.5) or (moved > STILL and waited < self._habits.patience):
            self._plant.hand = HandLaw(
                target=before,
                stiffness=np.zeros(3),
                damping=0.3 * self._damping,
                rotation_damping=0.05 * float(self._damping[0]),
            )
            await self._clock.sleep(LOOK)
            now = self._plant.markers()[0]
            moved, before = float(np.linalg.norm(now - before)) / LOOK, now
            waited += LOOK
        self._plant.hand = None

    def _law(self, target: Vector3, fading: float = np.inf, until: float = np.inf) -> HandLaw:
        return HandLaw(
            target=target.copy(),
            stiffness=self._stiffness,
            damping=self._damping,
            rotation_damping=0.02 * float(self._damping[0]),
            fading=fading,
            until=until,
        )

    def _about(self, duration: float) -> float:
        return float(duration * self._rng.uniform(0.7, 1.3))
