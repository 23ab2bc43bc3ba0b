"""`fidim ui --web` in a real browser: who may see it, that keys arrive, that nothing comes from elsewhere.

FIDIM_PICTURES=new writes docs/pictures/ui-web.png anew; look at it.
"""

import asyncio
import os
import socket
import sys
from pathlib import Path

import pytest

from drivers.clock import LoopClock
from fidim_lab.app.service.lock import held
from fidim_lab.app.service.place import ServicePlace
from fidim_lab.app.tui.screens.bars import SETTLE

pytestmark = [pytest.mark.slow, pytest.mark.browser]
COMMAND = "from fidim_lab.app.cli import main; main()"
PICTURE = Path(__file__).parents[4] / "docs" / "pictures" / "ui-web.png"
CTRL = 2


@pytest.fixture
def port():
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


async def _served(port, folder, environment):
    """The process of `fidim ui --web`, and the address that it printed."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-c", COMMAND, "ui", str(folder), "--web", "--port", str(port)),
        stdout=asyncio.subprocess.PIPE,
        env=environment,
    )
    line = (await asyncio.wait_for(process.stdout.readline(), 60.0)).decode()
    return process, line.split()[-1]


def test_the_ui_in_a_browser_takes_keys_and_needs_the_token(fake, tmp_path, browser, port):
    runtime = tmp_path / "rt"
    runtime.mkdir(mode=0o700)
    place = ServicePlace(runtime, "x")
    fake.socket = place.socket
    environment = {**os.environ, "FIDIM_RUNTIME_DIR": str(runtime)}

    async def look():
        with held(place, fake.folder):
            serving = asyncio.ensure_future(fake.run())
            process, address = await _served(port, fake.folder, environment)
            try:
                async with browser() as page:
                    await _refused(page, address)
                    await _used(page, address, fake)
            finally:
                process.terminate()
                await process.wait()
                serving.cancel()
                await asyncio.gather(serving, return_exceptions=True)

    asyncio.run(look())


async def _refused(page, address):
    for wrong in (address.partition("#")[0], address[:-3] + "xyz"):
        await page.go("about:blank")
        await page.go(wrong)
        await page.until("document.body.innerText.includes('token is missing or wrong')", "a refusal")
        await page.evaluate("sessionStorage.clear()")
    await page.go("about:blank")
    page.asked.clear()
    page.refused.clear()


async def _used(page, address, fake):
    await page.go(address)
    assert "token" not in await page.evaluate("location.href")
    assert not await page.evaluate("document.cookie")
    await page.tell("Emulation.setFocusEmulationEnabled", enabled=True)
    await page.wait(lambda: "● live" in page.frames, "the session")
    fake.ask()
    await page.wait(lambda: "ANSWER THIS" in page.frames, "a prompt")
    await page.wait(lambda: "E-STOP" in page.frames, "the keys below")
    await page.wait(lambda: _dull(page), "fonts")
    if os.environ.get("FIDIM_PICTURES") == "new":
        await page.picture(PICTURE)
    await page.tell("Emulation.setFocusEmulationEnabled", enabled=False)
    deaf = "document.body.classList.contains('-deaf')"
    await page.until(deaf, "a warning that keys go elsewhere")
    await page.tell("Emulation.setFocusEmulationEnabled", enabled=True)
    await page.until(f"!{deaf}")
    await LoopClock().sleep(2 * SETTLE)  # until then the prompt takes no key, and all this may have been quick
    await page.press("d")
    await page.wait(lambda: "answer" in fake.commands(), "an answer")
    await page.press("F12")
    await page.wait(lambda: "e-stop" in fake.commands(), "the emergency stop")
    await page.wait(lambda: "L A T C H E D" in page.frames, "the alarm")
    fake.asked.clear()
    await page.press("e", CTRL)
    await page.wait(lambda: "e-stop" in fake.commands(), "the emergency stop by Ctrl+E")
    assert [text for text in page.console if "403" not in text] == []  # those are of the refusals before
    assert [one for one in page.refused if "favicon" not in one] == []
    home = address.partition("://")[2].partition("/")[0]
    assert {one.partition("://")[2].partition("/")[0] for one in page.asked if not one.startswith("data:")} == {home}
    await page.press("q")
    await page.until("document.body.classList.contains('-closed')")
    assert "NO KEY OF THIS SCREEN STOPS" in await page.evaluate("document.body.innerText")


async def _dull(page):
    return await page.evaluate("document.fonts.ready.then(() => true)")
