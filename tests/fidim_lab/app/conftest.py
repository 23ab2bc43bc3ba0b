"""A real browser for tests: Chromium without a window, driven through its DevTools protocol. No other dependency.

`browser(…)` opens it. Tests that use it are skipped where there is no Chromium.
"""

import asyncio
import base64
import json
import os
import shutil
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import pytest
from aiohttp import ClientSession, WSMsgType

from drivers.clock import LoopClock

PROGRAM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
PATIENCE = 60.0
KEYS = {"F12": (123, ""), "Escape": (27, ""), "Enter": (13, "\r"), "ArrowLeft": (37, "")}


class Page:
    """One tab. What the browser said is kept: `console` (errors), `asked` and `refused`
    (addresses), `frames` (text)."""

    def __init__(self, socket):
        self._socket = socket
        self._number = 0
        self._waiting = {}
        self.console, self.asked, self.refused, self.frames = [], [], [], ""

    async def listen(self):
        async for message in self._socket:
            if message.type is not WSMsgType.TEXT:
                return
            told = json.loads(message.data)
            if "id" in told:
                self._waiting.pop(told["id"]).set_result(told)
            else:
                self._heard(told["method"], told["params"])

    def _heard(self, method, about):
        match method:
            case "Runtime.exceptionThrown":
                self.console.append(about["exceptionDetails"].get("exception", {}).get("description", "exception"))
            case "Runtime.consoleAPICalled" if about["type"] in ("error", "assert"):
                self.console.append(" ".join(str(one.get("value", one.get("description"))) for one in about["args"]))
            case "Log.entryAdded" if about["entry"]["level"] == "error":
                self.console.append(about["entry"]["text"])
            case "Network.requestWillBeSent":
                self.asked.append(about["request"]["url"])
            case "Network.responseReceived" if about["response"]["status"] >= 400:
                self.refused.append(about["response"]["url"])
            case "Network.webSocketCreated":
                self.asked.append(about["url"])
            case "Network.webSocketFrameReceived":
                data = about["response"]["payloadData"]
                binary = about["response"]["opcode"] == 2
                self.frames += base64.b64decode(data).decode(errors="replace") if binary else data

    async def tell(self, method, **parameters):
        self._number += 1
        number, answer = self._number, asyncio.get_running_loop().create_future()
        self._waiting[number] = answer
        await self._socket.send_str(json.dumps({"id": number, "method": method, "params": parameters}))
        told = await asyncio.wait_for(answer, PATIENCE)
        assert "error" not in told, told["error"]
        return told["result"]

    async def go(self, address, width=1000, height=640):
        for domain in ("Page", "Runtime", "Network", "Log"):
            await self.tell(f"{domain}.enable")
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        await self.tell("Emulation.setDeviceMetricsOverride", **size)
        await self.tell("Page.navigate", url=address)
        await self.until("document.readyState === 'complete'")

    async def evaluate(self, script):
        told = await self.tell("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in told, told["exceptionDetails"]
        return told["result"].get("value")

    async def until(self, script, what=""):
        await self.wait(lambda: self.evaluate(script), what or script)

    async def wait(self, wanted, what):
        """Until `wanted()` is true; it may be a coroutine function."""
        clock = LoopClock()
        end = clock.now() + PATIENCE
        while clock.now() < end:
            found = wanted()
            if await found if asyncio.iscoroutine(found) else found:
                return
            await clock.sleep(0.1)
        pytest.fail(f"never came in the browser: {what}; console {self.console}; it showed {self.frames[-600:]!r}")

    async def press(self, key, modifiers=0):
        code, text = KEYS.get(key, (ord(key.upper()[0]), key))
        about = {"key": key, "windowsVirtualKeyCode": code, "modifiers": modifiers}
        typed = {} if modifiers or not text else {"text": text}
        await self.tell("Input.dispatchKeyEvent", type="keyDown", **about, **typed)
        await self.tell("Input.dispatchKeyEvent", type="keyUp", **about)

    async def picture(self, path=None, **more):
        data = base64.b64decode((await self.tell("Page.captureScreenshot", format="png", **more))["data"])
        if path is not None:
            Path(path).write_bytes(data)
        return data

    async def pdf(self):
        return base64.b64decode((await self.tell("Page.printToPDF", preferCSSPageSize=True))["data"])


async def _address(profile):
    """Of the only tab; the browser writes its port into its profile."""
    file, clock = profile / "DevToolsActivePort", LoopClock()
    for _ in range(600):
        if file.exists() and (port := file.read_text().splitlines()[:1]):
            async with ClientSession() as session, session.get(f"http://127.0.0.1:{port[0]}/json/list") as answer:
                tabs = [tab for tab in await answer.json(content_type=None) if tab["type"] == "page"]
            if tabs:
                return tabs[0]["webSocketDebuggerUrl"]
        await clock.sleep(0.1)
    pytest.fail("the browser did not begin")


@pytest.fixture
def browser(tmp_path):
    """`async with browser() as page`: a page of a browser of its own."""
    if PROGRAM is None:
        pytest.skip("no Chromium here (apt install chromium)")

    @asynccontextmanager
    async def opened():
        profile = tmp_path / "chromium"
        process = await asyncio.create_subprocess_exec(
            *(PROGRAM, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run"),
            *("--remote-debugging-port=0", f"--user-data-dir={profile}", "about:blank"),
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.DEVNULL,
        )
        try:
            async with (
                ClientSession() as session,
                session.ws_connect(await _address(profile), max_msg_size=0) as socket,
            ):
                page = Page(socket)
                listening = asyncio.ensure_future(page.listen())
                try:
                    yield page
                finally:
                    listening.cancel()
                    await asyncio.gather(listening, return_exceptions=True)
        finally:
            with suppress(ProcessLookupError):
                process.terminate()
            await process.wait()

    return opened


@pytest.fixture
def typing():
    """What a person types, or a pipe brings, before the command is run: `typing(b"yes\\n")`; its end follows."""
    kept = os.dup(0)

    def typed(data: bytes) -> None:
        end, begin = os.pipe()
        os.write(begin, data)
        os.close(begin)
        os.dup2(end, 0)
        os.close(end)

    yield typed
    os.dup2(kept, 0)
    os.close(kept)
