"""Keeps RIG.home.toml while a rig is open: new zeros when `home` made some, and where each encoder was seen."""

import asyncio
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime

from drivers.cia402.bring_up import Zeroed
from drivers.cia402.motion import Cia402Winch
from drivers.ports import Clock
from fidim_lab.data.rigs.home_file import WinchHome, write_homes
from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.errors import HardwareError

PERIOD = 1.0
"""s between two looks"""


class HomeKeeper:
    """Reads the winches, writes the file. A rig whose winches were never homed gets none."""

    def __init__(self, file: RigFile, winches: Sequence[Cia402Winch], clock: Clock) -> None:
        self._file = file
        self._winches = tuple(winches)
        self._clock = clock
        self._homes: dict[str, WinchHome] = {entry.name: entry.home for entry in file.winches if entry.home is not None}
        self._zeroed: dict[str, Zeroed] = {}

    async def run(self) -> None:
        """Look again and again; writes the last word in the end. A disk that is full does not end a session."""
        try:
            while True:
                await self._clock.sleep(PERIOD)
                await self._keep()
        finally:
            await self._keep()

    async def _keep(self) -> None:
        """In a thread, since the disk may take its time; shielded, since the last word counts."""
        homes = self._present()
        if homes == self._homes:
            return
        try:
            await asyncio.shield(asyncio.to_thread(write_homes, self._file.path, homes))
        except HardwareError:
            return  # tried again; the zero that was kept before is refused if it is wrong
        self._homes = dict(homes)

    def _present(self) -> Mapping[str, WinchHome]:
        homes = dict(self._homes)
        for winch in self._winches:
            if (zeroed := winch.zeroed) is not None and self._zeroed.get(winch.name) != zeroed:
                self._zeroed[winch.name] = zeroed
                homes[winch.name] = _home(winch, zeroed)
            values = winch.link.values
            if winch.name in homes and values is not None and not values.velocity:
                homes[winch.name] = homes[winch.name].model_copy(update={"last_count": values.position})
        return homes


def _home(winch: Cia402Winch, zeroed: Zeroed) -> WinchHome:
    return WinchHome(
        node_id=winch.config.node_id,
        vendor_id=zeroed.vendor_id,
        product_code=zeroed.product_code,
        serial_number=zeroed.serial_number,
        home_count=zeroed.count,
        home_length=round(zeroed.length, 7),
        at=datetime.now(UTC).isoformat(timespec="seconds"),
    )
