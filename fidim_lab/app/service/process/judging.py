"""Handler of `Explain`: the judgement in a process of its own, so that the control loop goes on beside it."""

import asyncio
import json
import os
import sys
from contextlib import suppress
from pathlib import Path

from fidim_lab.data.files.input_file import read_json
from fidim_lab.errors import FileError
from procedures.outcomes import Outcome
from procedures.stand import Stand
from procedures.steps import Result
from procedures.steps.compare import Clarity, Explain
from procedures.timing import POLL

MODULE, JUDGEMENT = "fidim_lab.app.judging.judgement", "judgement.json"
LONGEST = 1800.0
"""s"""


async def explain_step(stand: Stand, step: Explain) -> Result:
    """Have the run's folder judged; the robot is held, and guards look on."""
    folder, clock = stand.folder.path, stand.rig.clock
    (folder / JUDGEMENT).unlink(missing_ok=True)
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", MODULE, str(folder), str(step.number)),
        json.dumps(stand.settings.motion.length_limits),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.PIPE,
        start_new_session=True,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    ended = asyncio.ensure_future(process.communicate())
    begin = clock.now()
    try:
        while not ended.done():
            stand.progress((clock.now() - begin) / step.estimate)
            if clock.now() - begin > LONGEST:
                return Result(Outcome.FAIL, f"The explanation took longer than {LONGEST:g} s.", answer=Clarity.STUCK)
            await clock.sleep(POLL)
    finally:
        if not ended.done():
            with suppress(ProcessLookupError):
                process.kill()
        await asyncio.gather(ended, return_exceptions=True)
    said = ended.result()[1].decode(errors="replace").strip()
    return _result(folder / JUDGEMENT, process.returncode, said)


def _result(path: Path, code: int | None, said: str) -> Result:
    try:
        found = read_json(path)
        clarity, window = Clarity(found["clarity"]), tuple(float(value) for value in found["window"])
        return Result(reason=str(found["says"]), answer=clarity, values=window)
    except (FileError, ValueError, KeyError, TypeError):
        last = said.splitlines()[-1] if said else f"exit code {code}"
        return Result(Outcome.FAIL, f"The recording could not be explained: {last}", answer=Clarity.STUCK)
