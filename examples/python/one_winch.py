"""One CiA 402 winch by itself: 5 cm out, slowly, held, power off. Without load, with the emergency stop at hand.

fidim simulators examples/rigs/simulated.toml                          # in another terminal, or a real drive
python examples/python/one_winch.py slcan socket://127.0.0.1:20100
"""

import asyncio
import sys

from drivers.canbus.python_can import PythonCanTransport
from drivers.canbus.transport import CanTransport
from drivers.cia402.dictionary import WinchConfig
from drivers.cia402.motion import Cia402Winch
from drivers.cia402.watch import CanopenMaster
from drivers.clock import LoopClock

WINCH = WinchConfig(
    name="winch 1", node_id=1, counts_per_turn=40960.0, drum_radius=0.03, rated_current=5.0, current_limit=10.0,
    max_speed=0.1, max_acceleration=0.5, length_limits=(0.3, 3.5), home_length=1.5, host_timeout=1.5, heartbeat=0.3,
)  # fmt: skip


async def pay_out(transport: CanTransport, config: WinchConfig = WINCH, way: float = 0.05) -> tuple[float, float]:
    """Cable length (m) before and after. The master keeps SYNC and heartbeat going; without it the drive stops."""
    master = CanopenMaster(transport, LoopClock(), sync_rate=100.0)
    winch = Cia402Winch(config, master)
    loop = asyncio.create_task(master.run())
    try:
        await winch.configure()  # identity, stop reactions, limits and PDOs are written and read back
        await winch.enable()
        start = await winch.ask_length()
        await winch.move_to(start + way, speed=0.05, acceleration=0.2)  # begins the move …
        await master.clock.sleep(way / 0.05 + 1.0)  # … and this gives it the time
        await winch.hold()
        return start, await winch.ask_length()
    finally:
        winch.power_off()
        await master.clock.sleep(0.2)
        loop.cancel()


if __name__ == "__main__":
    bus = PythonCanTransport(*sys.argv[1:3], bitrate=1_000_000, sleep_after_open=0.1)
    print("length before and after: {:.4f} m, {:.4f} m".format(*asyncio.run(pay_out(bus))))
    bus.close()
