"""The UI in a browser of this computer: textual-serve behind a token, which it does not have itself.

The address that is printed ends in `#token=…`. A browser sends that part to nobody: the page (our own, `page/`) keeps
it for this tab and opens the socket with it. There is no cookie, because a browser sends cookies to every port of a
host, so also to another user's server on this computer. What needs no token shows nothing of the robot.

Requests are answered only for 127.0.0.1 and localhost at our own port (so no name that was rebound to this computer
works), and only from our own page: `Origin` and `Sec-Fetch-Site` name the page that asks.
"""

import hmac
import secrets
import shlex
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import aiohttp_jinja2
import jinja2
from aiohttp import web
from textual_serve.server import Server

from fidim_lab.app.tui.themes import DARK, LIGHT
from fidim_lab.errors import SetupError

HOST = "127.0.0.1"
PAGE = Path(__file__).parent / "page"
FONT_SIZES = range(8, 65)
FONT_SIZE = 16
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self' 'unsafe-inline'; style-src 'self' 'unsafe-inline'; font-src 'self'; "
        "img-src 'self' data:; connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
}
"""no request leaves for another computer; no other page shows this one, reads it or holds its window"""
COMMAND = "from fidim_lab.app.cli import main; main()"
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class TokenServer(Server):
    """textual-serve that answers only its own page, and shows the robot only to those who know the token."""

    def __init__(self, command: str, port: int, token: str, *, light: bool = False) -> None:
        super().__init__(command, host=HOST, port=port, title="fidim", templates_path=PAGE)
        self._token = token
        self._theme = LIGHT if light else DARK

    @property
    def address(self) -> str:
        """With the token, for the person who started it."""
        return f"{self.public_url}/#token={self._token}"

    async def make_app(self) -> web.Application:
        """The aiohttp application: the page, what it is made of, and the socket. Every route of it is guarded."""

        @web.middleware
        async def guard(request: web.Request, handler: Handler) -> web.StreamResponse:
            return await self._guard(request, handler)

        app = web.Application(middlewares=[guard])
        aiohttp_jinja2.setup(app, loader=jinja2.FileSystemLoader(self.templates_path))
        app.router.add_get("/", self.handle_index)
        app.router.add_get("/ws/{token}", self.handle_websocket)
        app.router.add_static("/static", self.statics_path)
        app.on_startup.append(self.on_startup)
        app.on_response_prepare.append(_closed)
        return app

    async def on_startup(self, app: web.Application) -> None:
        """Say where it is."""
        sys.stdout.write(f"The UI is at {self.address}\nCtrl-C ends the UI; the run continues.\n")
        sys.stdout.flush()

    async def handle_index(self, request: web.Request) -> web.StreamResponse:  # type: ignore[override]
        """The page; it says nothing of the robot."""
        context: dict[str, Any] = {
            "name": "fidim",
            "font_size": FONT_SIZE,
            "font_sizes": [FONT_SIZES.start, FONT_SIZES.stop - 1],
            "ground": self._theme.background,
            "ink": self._theme.foreground,
        }
        return aiohttp_jinja2.render_template("app_index.html", request, context)

    async def handle_websocket(self, request: web.Request) -> web.WebSocketResponse:
        """A UI of its own for this tab. Only a browser's page that was served here has the right `Origin`."""
        if request.headers.get("Origin") != f"http://{request.host}":
            raise web.HTTPForbidden(text="The UI's socket is for the UI's own page.")
        if not hmac.compare_digest(request.match_info["token"].encode(errors="replace"), self._token.encode()):
            raise web.HTTPForbidden(text="The token is wrong: use the address that fidim ui --web printed.")
        return await super().handle_websocket(request)

    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        if request.host not in (f"{HOST}:{self.port}", f"localhost:{self.port}"):
            raise web.HTTPForbidden(text="This UI is available on this computer only.")
        if request.headers.get("Origin", f"http://{request.host}") != f"http://{request.host}":
            raise web.HTTPForbidden(text="This UI accepts no requests from other pages.")
        followed = request.path == "/" and request.headers.get("Sec-Fetch-Dest") == "document"  # a link, from anywhere
        if not followed and request.headers.get("Sec-Fetch-Site", "none") not in ("same-origin", "none"):
            raise web.HTTPForbidden(text="This UI accepts no requests from other pages.")
        return await handler(request)


async def _closed(request: web.Request, response: web.StreamResponse) -> None:
    response.headers.update(HEADERS)


def command_line(folder: Path | None, rig: Path | None, *, light: bool) -> str:
    """What textual-serve runs for each browser."""
    words = [sys.executable, "-c", COMMAND, "ui"]
    words += [str(folder.absolute())] if folder is not None else []
    words += ["--rig", str(rig.absolute())] if rig is not None else []
    words += ["--light"] if light else []
    return shlex.join(words)


def serve(folder: Path | None, rig: Path | None, port: int, *, light: bool = False) -> None:
    """Serve until Ctrl-C. Raises SetupError where the port is taken."""
    server = TokenServer(command_line(folder, rig, light=light), port, secrets.token_urlsafe(24), light=light)
    try:
        web.run_app(server.make_app(), host=HOST, port=port, print=None)
    except OSError as error:
        what = f"--port {port}: {HOST}:{port} cannot be used: {error.strerror or error}."
        raise SetupError(what, hint="Another fidim ui --web may use it; choose another --port.") from error
