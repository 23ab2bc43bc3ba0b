"""The UI in a browser of this computer: textual-serve behind a token, which it does not have itself.

Only 127.0.0.1 is listened at. Whoever comes first must know the token (in the address that is printed); a cookie
(HttpOnly, SameSite=Strict) holds it from then on, so that no page of another site can open the socket. The page is our
own (`page/`): nothing of it comes from another computer, and where its key would stop nothing it says so.
"""

import hmac
import secrets
import shlex
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from aiohttp import web
from aiohttp_jinja2 import render_template
from textual_serve.server import Server

from fidim_lab.app.tui.themes import DARK, LIGHT
from fidim_lab.errors import SetupError

HOST = "127.0.0.1"
COOKIE = "fidim-ui"
PAGE = Path(__file__).parent / "page"
FONT_SIZES = range(8, 65)
FONT_SIZE = 16
POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline'; style-src 'self' 'unsafe-inline'; font-src 'self'; "
    "img-src 'self' data:; connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)
"""no request leaves for another computer, no other page shows this one in a frame"""
COMMAND = "from fidim_lab.app.cli import main; main()"
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class TokenServer(Server):
    """textual-serve that answers only those who know the token."""

    def __init__(self, command: str, port: int, token: str, *, light: bool = False) -> None:
        super().__init__(command, host=HOST, port=port, title="fidim", templates_path=PAGE)
        self._token = token
        self._theme = LIGHT if light else DARK

    @property
    def address(self) -> str:
        """With the token, for the person who started it."""
        return f"{self.public_url}/?token={self._token}"

    async def make_app(self) -> web.Application:
        """The aiohttp application, every route of it guarded."""

        @web.middleware
        async def guard(request: web.Request, handler: Handler) -> web.StreamResponse:
            return await self._guard(request, handler)

        app = await self._make_app()
        app.middlewares.append(guard)
        app.on_response_prepare.append(_closed)
        return app

    async def on_startup(self, app: web.Application) -> None:
        """Say where it is."""
        sys.stdout.write(f"The UI is at {self.address}\nCtrl-C ends it; the run goes on.\n")
        sys.stdout.flush()

    async def handle_index(self, request: web.Request) -> web.StreamResponse:  # type: ignore[override]
        """The page, with addresses of the name it was asked for by: 127.0.0.1 and localhost have cookies apart."""
        asked = request.query.get("fontsize", "")
        wanted = int(asked) if asked.isdecimal() and int(asked) in FONT_SIZES else FONT_SIZE
        context: dict[str, Any] = {
            "application": {"name": "fidim"},
            "socket": f"ws://{request.host}/ws",
            "font_size": wanted,
            "ground": self._theme.background,
            "ink": self._theme.foreground,
        }
        return render_template("app_index.html", request, context)

    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        if request.host not in (f"{HOST}:{self.port}", f"localhost:{self.port}"):
            raise web.HTTPForbidden(text="This UI is served to this computer only.")
        given = request.query.get("token") or request.cookies.get(COOKIE, "")
        if not hmac.compare_digest(given.encode(), self._token.encode()):
            raise web.HTTPForbidden(text="The token is missing or wrong: use the address that fidim ui --web printed.")
        if "token" not in request.query:
            return await handler(request)
        # The token does not stay in the address bar, nor in a history.
        kept = request.rel_url.without_query_params("token")
        answer = web.Response(status=302, headers={"Location": f"/?{kept.query_string}"})
        answer.set_cookie(COOKIE, self._token, httponly=True, samesite="Strict", path="/")
        return answer


async def _closed(request: web.Request, response: web.StreamResponse) -> None:
    response.headers["Content-Security-Policy"] = POLICY
    response.headers["X-Content-Type-Options"] = "nosniff"
    response.headers["Referrer-Policy"] = "no-referrer"


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
        what = f"--port {port}: {HOST}:{port} cannot be listened at: {error.strerror or error}."
        raise SetupError(what, hint="Another fidim ui --web may be there; give another --port.") from error
