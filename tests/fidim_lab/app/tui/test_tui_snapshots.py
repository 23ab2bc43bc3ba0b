"""Every screen in every state, whole, as it stands on the terminal: compared with texts that a person has looked at.

FIDIM_PICTURES=new writes the texts anew (look at what git says has changed). FIDIM_GALLERY=FOLDER also draws each as an
SVG file, in colour, to be looked at.
"""

import asyncio
import math
import os
import re
import shutil
from pathlib import Path

import pytest

from fidim_lab.app.service.messages import Bye, EquilibriumState, GuardState, Happening, Samples
from fidim_lab.app.tui.foresight import Foreseen
from fidim_lab.app.tui.screens.bars import TABS

PICTURES = Path(__file__).parent / "pictures"
GALLERY = os.environ.get("FIDIM_GALLERY")
STATES = ("running", "prompt", "fault", "stopped", "lost", "ended")
SIZES = {"80x24": (80, 24), "120x40": (120, 40)}


def _table():
    """A session of twelve and three, half of it done."""
    rows = [
        EquilibriumState(
            window=f"i{k:02}",
            role="identify",
            state="done",
            verdict="pass",
            attempts=1,
            margin=20.0 + k,
            amplitude=0.07,
        )
        for k in range(1, 7)
    ]
    rows[3] = rows[3].model_copy(
        update={"verdict": "marginal", "attempts": 2, "reason": "amplitude 41 mm is near the least, 40 mm"}
    )
    rows[4] = rows[4].model_copy(
        update={
            "verdict": "fail",
            "attempts": 3,
            "reason": "the marker was not seen in 14 % of the frames, 5 % are allowed, at the third attempt too",
        }
    )
    rows.append(EquilibriumState(window="i07", role="identify", state="current", attempts=1, margin=12.0))
    rows += [EquilibriumState(window=f"i{k:02}", role="identify", state="waiting") for k in range(8, 13)]
    return (*rows, *(EquilibriumState(window=f"v{k:02}", role="validate", state="waiting") for k in (1, 2, 3)))


def _events():
    said = [
        ("run-started", "", "two windows", "", ""),
        ("step-started", "i07", "move by way of lengths 1.395 1.853 1.595 0.975 m, at most 0.1 m/s", "", ""),
        ("step-finished", "i07", "", "pass", ""),
        ("window-finished", "i05", "", "fail", "the marker was not seen in 14 % of the frames, 5 % are allowed"),
        ("guard-warned", "", "bus errors winch 1: 26 bus cycles of the last second brought no sample", "", ""),
        ("guard-tripped", "i07", "tension winch 1: 201.0 N, 200 N allowed", "", ""),
        (
            "model-checked",
            "i06",
            "6 windows so far: χ²/dof 3.4 over the first 2 s; suspected: swivel-friction, log-evidence 210.",
            "swivel-friction",
            "",
        ),
        ("prompt", "i07", "Displace the platform by x -20 mm, y +40 mm, keep it still, and let go.", "", ""),
    ]
    return [
        Happening(
            number=k, t=k, wall=f"2026-01-02T10:11:{k:02}.000", kind=kind, window=w, text=text, outcome=o, reason=r
        )
        for k, (kind, w, text, o, r) in enumerate(said, start=1)
    ]


async def _recording(screen):
    """Four seconds of a swing, and the model a little off it."""
    t = [10.0 + 0.01 * k for k in range(400)]
    positions = tuple((1.1 + 0.02 * math.sin(6 * x), -0.27 + 0.04 * math.cos(8 * x), -0.3) for x in t)
    none = tuple(() for _ in t)
    ahead = [10.0 + 0.02 * k for k in range(400)]
    model = [(1.1 + 0.021 * math.sin(6.05 * x), -0.27 + 0.04 * math.cos(8.02 * x), -0.3) for x in ahead]
    screen.app.stage.foresight.found = Foreseen(("i07", 1), 2.0, "CAD", ahead, model)
    screen.service.say(Samples(window="i07", attempt=1, t=tuple(t), positions=positions, tensions=none, lengths=none))
    await screen.until(lambda: len(screen.app.link.view().trace.t) == len(t), "samples")


async def _become(screen, state):
    service = screen.service
    service.become(equilibria=_table())
    await screen.until(lambda: "v03" in screen.board, "the table")
    match state:
        case "running":
            await _recording(screen)
        case "prompt":
            service.ask(window="i07")
            await screen.until(lambda: "[d] done" in screen.bars, "the prompt")
        case "fault":
            service.become(
                phase="stopping",
                equilibria=_table(),
                winches=service.winches(
                    drive="fault",
                    fault="0x3210 overvoltage of the DC link: the brake resistor is missing",
                    tension=204.0,
                ),
                guards=(
                    GuardState(
                        name="tension", state="tripped", reaction="quick stop", why="winch 1: 204 N, 200 N allowed"
                    ),
                    GuardState(name="marker", state="warning", reaction="hold", why="not seen for 0.4 s"),
                    GuardState(name="slip", state="disarmed", reaction="hold"),
                ),
            )
            await screen.until(lambda: "STOPPING" in screen.bars, "the fault")
        case "stopped":
            await screen.press("f12")
            await screen.until(lambda: "All winches were quick-stopped" in screen.bars, "the stop")
        case "lost":
            screen.kill_service()
            await screen.until(lambda: "no service listens" in screen.bars, "the loss")
        case _:
            whole = {"state": "done", "verdict": "pass", "attempts": 1, "margin": 20.0, "amplitude": 0.06}
            rows = tuple(row if row.state == "done" else row.model_copy(update=whole) for row in _table())
            service.become(phase="ended", equilibria=rows)
            service.say(Bye(says="run pass: 15 of 15 windows accepted. All winches stand still, held.", exit_code=0))
            await screen.until(lambda: "HAS ENDED" in screen.bars, "the end")


def _shown(app):
    """Text of the whole terminal; what the passing of time changes is put aside."""
    rows = ["".join(part.text for part in strip).rstrip() for strip in app.screen._compositor.render_strips()]
    text = "\n".join(rows) + "\n"
    text = re.sub(r"ARE \d+ s OLD", "ARE 0 s OLD", re.sub(r"values of \d+ s ago", "values of 0 s ago", text))
    text = re.sub(r"✗ OLD [\d.]+ s", "✗ OLD 1.0 s", text)
    text = re.sub(r"^/tmp/\S+: no service.*\n", "SOCKET: no service listens there\n", text, flags=re.MULTILINE)
    return re.sub(r"newest \d+ ms", "newest 20 ms", re.sub(r" +\d+ ms old", "    10 ms old", text))


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("state", STATES)
def test_every_screen_looks_as_it_was_approved(opened, fake, monkeypatch, state, size):
    monkeypatch.setattr("fidim_lab.app.tui.stage.NOTICE_FOR", 1e6)
    monkeypatch.setattr("fidim_lab.app.tui.screens.rig.OLD", 1e6)  # tests share a busy computer
    monkeypatch.setattr("fidim_lab.app.tui.view.STALE", 1e6)
    for name in ("result.json", "explanation.json"):
        shutil.copy(PICTURES / "run" / name, fake.folder / name)
    fake.events[:] = _events()

    async def look():
        async with opened(size=SIZES[size], light=size != "80x24") as screen:
            await _become(screen, state)
            found = [await _turned(screen, index, state) for index in range(len(TABS))]
            _compare(f"app-{state}-{screen.app.size.width}", "".join(found), screen.app.size.width)

    asyncio.run(look())


async def _turned(screen, index, state):
    name = TABS[index].lower()
    screen.app.screen.action_turn(index)
    shown = ""
    # until nothing changes any more; the files, which are there from the beginning, are read by a thread
    while shown != (shown := _shown(screen.app)) or "Nothing is identified yet" in shown:
        screen.app.stage.draw(screen.app.link.view())
        await screen.pilot.pause(0.1)
    if GALLERY:
        path = Path(GALLERY) / f"{name}-{state}-{screen.app.size.width}.svg"
        path.write_text(screen.app.export_screenshot(), encoding="utf-8")
    return f"===== {name}\n{shown}"


def _compare(name, text, width):
    assert all(len(row) <= width for row in text.splitlines())
    file = PICTURES / f"{name}.txt"
    if os.environ.get("FIDIM_PICTURES") == "new":
        file.write_text(text, encoding="utf-8")
    assert text == file.read_text(encoding="utf-8")
