"""The worker of `model_check`: reads what is new in a run's folder, and looks whether the model holds so far.

A process of its own: started by `ModelCheck`, one line on standard input is one look, one line of JSON the answer.
It keeps what each window says of every hypothesis, 25 MB a window of ten seconds: a night's hundreds would fill a
computer on which a robot hangs, so it looks at the first `MOST`, which is more than twelve and the 22 held out.
"""

import json
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Any

from fidim_lab.app.terminal.worker_pipe import requests
from fidim_lab.data.campaign import read_campaign
from fidim_lab.errors import FidimError
from fidim_lab.mismatch.online_monitor import SoFar, Watch

NICE = 15
MOST = 36
"""windows that are looked at"""


class Looker:
    """Reads what is new in a run's folder, and looks."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._watch: Watch | None = None
        self._known: set[str] = set()

    @property
    def full(self) -> bool:
        """Whether no further window will be looked at."""
        return len(self._known) >= MOST

    def look(self) -> SoFar:
        """Take in the windows accepted since the last look, as long as there is room. Raises FileError."""
        campaign = read_campaign(self._folder)
        if self._watch is None:
            self._watch = Watch(campaign.robot)
        new = [window for window in campaign.windows if window.id not in self._known][: MOST - len(self._known)]
        self._known |= {window.id for window in new}
        return self._watch.look(new)


def answer_to(looker: Looker, clock: Callable[[], float]) -> dict[str, Any]:
    """One answer as it goes over the pipe: `SoFar`, s it took, whether it is the last; or why it `failed`."""
    begin = clock()
    try:
        found = looker.look()
    except FidimError as error:
        return {"failed": str(error).splitlines()[0]}
    return {**asdict(found), "took": round(clock() - begin, 3), "full": looker.full}


def main(folder: str) -> None:
    """The worker: for each line on standard input an answer on standard output."""
    with suppress(OSError, AttributeError):
        os.nice(NICE)
    looker = Looker(Path(folder))
    for _ in requests():
        sys.stdout.write(json.dumps(answer_to(looker, perf_counter)) + "\n")
        sys.stdout.flush()
