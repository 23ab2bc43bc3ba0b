"""Proofs by trial of a rig: which of them hold today, and keeping what `fidim commission` has tried."""

import asyncio
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from drivers.cia402.dictionary import TrialPassed, WinchConfig, stop_settings
from drivers.ports import Disk, Trial
from fidim_lab.data.rigs.proof_file import NAME, KeptProof, proofs_path, read_proofs, with_newer, write_proofs
from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.errors import HardwareError
from procedures.events import Event, StepFinished
from procedures.outcomes import Outcome
from procedures.steps.commission import ProveStop


def held_proofs(file: RigFile, config: WinchConfig) -> tuple[TrialPassed, ...]:
    """Those of a winch whose settings are today's, and whose drive may be the one that the rig file names.

    Whether it is the one on the bus, bring-up sees by its serial number. A rehearsal has proofs of its own.
    """
    kept = read_proofs(proofs_path(file.path, embedded=not file.keeps_homes))
    return tuple(_proof(proof) for proof in kept if proof.winch == config.name and not void(proof, file, config))


def void(proof: KeptProof, file: RigFile, config: WinchConfig) -> str:
    """Why a kept proof does not hold any more, in words; empty where it does."""
    if proof.trial not in tuple(Trial):
        return f"this version knows no trial {proof.trial!r}"
    wanted = {
        "vendor_id": config.vendor_id,
        "product_code": config.product_code,
        "serial_number": config.serial_number,
    }
    for key, value in wanted.items():
        if value is not None and getattr(proof, key) != value:
            return f"another drive was tried: {key} {getattr(proof, key)}, the rig file says {value}"
    today = stop_settings(config, file.bus.host_id)
    for name in sorted({*today, *proof.settings}):
        if proof.settings.get(name) != today.get(name):
            return f"{name} was {_said(proof.settings, name)} when it was tried, and is {_said(today, name)} now"
    return ""


def _said(settings: Mapping[str, int], name: str) -> str:
    return str(settings.get(name, "not told"))


def _proof(kept: KeptProof) -> TrialPassed:
    return TrialPassed(
        Trial(kept.trial),
        kept.serial_number,
        kept.speed,
        kept.time,
        kept.distance,
        by=kept.by,
        at=kept.at,
        faulted=kept.faulted,
    )


class ProofKeeper:
    """A listener of `commission`: keeps each trial that was passed, and forgets the proof of one that was not."""

    def __init__(
        self,
        file: RigFile,
        configs: tuple[WinchConfig, ...],
        folder: Path,
        by: str,
        wall_time: Callable[[], str],
        tell: Callable[[str], None],
        disk: Disk,
    ) -> None:
        """by: the person who is there. tell: told where the disk does not take it; a listener must not raise."""
        self._file = file
        self._configs = configs
        self._folder = folder
        self._by = by
        self._wall_time = wall_time
        self._tell = tell
        self._disk = disk
        self._passed: dict[tuple[str, str], KeptProof] = {}
        self._failed: set[tuple[str, str]] = set()
        self._writing: asyncio.Task[None] | None = None

    def __call__(self, event: Event) -> None:
        """Take one event of the run."""
        if not isinstance(event, StepFinished) or not isinstance(event.step, ProveStop):
            return
        step, result = event.step, event.result
        key = self._configs[step.winch].name, step.trial.value
        if result.outcome is Outcome.SKIPPED:
            return
        self._passed.pop(key, None)
        self._failed.add(key)
        if result.outcome.usable:
            self._failed.discard(key)
            vendor, product, revision, serial = (int(number) for number in result.readings["identity"])
            time, distance = result.values
            settings = stop_settings(self._configs[step.winch], self._file.bus.host_id)
            self._passed[key] = KeptProof(
                winch=key[0],
                trial=key[1],
                vendor_id=vendor,
                product_code=product,
                revision_number=revision,
                serial_number=serial,
                speed=step.speed,
                time=round(time, 3),
                distance=round(distance, 5),
                by=self._by,
                at=self._wall_time(),
                settings=settings,
                faulted="faulted" in result.readings,
            )
        before = self._writing
        self._writing = asyncio.ensure_future(self._write(before))

    async def _write(self, before: "asyncio.Task[None] | None") -> None:
        """One after the other."""
        if before is not None:
            await before
        passed, failed = list(self._passed.values()), sorted(self._failed)
        try:
            await self._disk.do(partial(write_proofs, self._folder / NAME, passed))
            path = proofs_path(self._file.path, embedded=not self._file.keeps_homes)
            kept = await self._disk.do(partial(read_proofs, path))
            await self._disk.do(partial(write_proofs, path, with_newer(kept, passed, failed)))
        except HardwareError as error:
            self._tell(str(error))

    async def closed(self) -> None:
        """Wait until all is written."""
        if self._writing is not None:
            await self._writing
