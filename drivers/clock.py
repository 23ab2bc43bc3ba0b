"""The clock of the running event loop. With a loop that jumps (simulation) it jumps; with the usual one it waits."""

import asyncio


class LoopClock:
    """`Clock` port on asyncio: `loop.time()` is monotonic, and the loop decides what a second costs."""

    def now(self) -> float:
        """Monotonic seconds of the running loop."""
        return asyncio.get_running_loop().time()

    async def sleep(self, seconds: float) -> None:
        """Let at least `seconds` pass."""
        await asyncio.sleep(max(seconds, 0.0))  # noqa: TID251 - this is the one place
