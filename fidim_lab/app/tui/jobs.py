"""Identify and explain from the UI: commands in processes of their own, their answers as files in the run's folder."""

import asyncio
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Literal

from drivers.ports import Clock
from fidim_lab.app.tui.aside import Aside, StalledError
from fidim_lab.app.tui.paint import time_span
from fidim_lab.app.tui.result_files import EXPLANATION, RESULT

Work = Literal["identify", "explain"]
FILES: dict[Work, str] = {"identify": RESULT, "explain": EXPLANATION}
COMMAND = "import os, sys; os.nice(10); from fidim_lab.app.cli import run; sys.exit(run(sys.argv[1:]))"


class Jobs:
    """One job at a time, niced."""

    def __init__(self, clock: Clock) -> None:
        self._aside = Aside(clock)
        self._doing = ""
        self._begun = 0.0
        self._failed = ""
        self._process: asyncio.subprocess.Process | None = None

    def says(self, now: float) -> str:
        """What to show of it at this time (s, any clock that `run` was given a time of)."""
        return f"{self._doing} {time_span(now - self._begun)} …" if self._doing else self._failed

    async def run(self, work: Work, folder: Path, now: float) -> None:
        """Run `fidim identify` or `fidim explain` on the folder, its answer beside the windows."""
        if self._doing:
            return
        self._doing, self._begun = f"fidim {work} {folder.name}: computing since", now
        try:
            self._failed = await self._worked(work, folder)
        except (OSError, StalledError) as error:
            self._failed = f"✗ fidim {work}: {error}"
        finally:
            self._doing = ""

    async def _worked(self, work: Work, folder: Path) -> str:
        """Why there is no answer; empty where there is one."""
        part = folder / f".{FILES[work]}.new"  # hidden: no part of the run, also where it is left behind
        self._process = process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-c", COMMAND, work, str(folder), "--json", str(part)),
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.PIPE,
            start_new_session=True,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        )
        _, err = await process.communicate()
        if process.returncode in (0, 1):
            await self._aside.run(lambda: part.exists() and part.replace(folder / FILES[work]))
        said = [text for text in err.decode(errors="replace").splitlines() if text.startswith("fidim: ")]
        failed = f"✗ fidim {work}: {' '.join(said)[7:] or f'ended with exit code {process.returncode}'}"
        return failed if process.returncode and not (process.returncode == 1 and not said) else ""

    def close(self) -> None:
        """End what is still computed."""
        if self._process is not None and self._process.returncode is None:
            with suppress(ProcessLookupError):
                self._process.kill()
