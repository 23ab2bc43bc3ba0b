"""The UI in a browser of this computer: textual-serve behind a token, which it does not have itself.

Only 127.0.0.1 is listened at. Whoever comes first must know the token (in the address that is printed); a cookie
(HttpOnly, SameSite=Strict) holds it from then on, so that no page of another site can open the socket.
"""

import hmac
import secrets
import shlex
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path

from aiohttp import web
from textual_serve.server import Server

HOST = "127.0.0.1"
COOKIE = "fidim-ui"
COMMAND = "from fidim_lab.app.cli import main; main()"
Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class TokenServer(Server):
    """textual-serve that answers only those who know the token."""

    def __init__(self, command: str, port: int, token: str) -> None:
        super().__init__(command, host=HOST, port=port, title="fidim")
        self._token = token

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
        return app

    async def on_startup(self, app: web.Application) -> None:
        """Say where it is."""
        sys.stdout.write(f"The UI is at {self.address}\nCtrl-C ends it; the run goes on.\n")
        sys.stdout.flush()

    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        if request.host not in (f"{HOST}:{self.port}", f"localhost:{self.port}"):
            raise web.HTTPForbidden(text="This UI is served to this computer only.")
        given = request.query.get("token") or request.cookies.get(COOKIE, "")
        if not hmac.compare_digest(given.encode(), self._token.encode()):
            raise web.HTTPForbidden(text="The token is missing or wrong: use the address that fidim ui --web printed.")
        if "token" not in request.query:
            return await handler(request)
        # The token does not stay in the address bar, nor in a history.
        answer = web.Response(status=302, headers={"Location": "/"})
        answer.set_cookie(COOKIE, self._token, httponly=True, samesite="Strict", path="/")
        return answer


def command_line(folder: Path | None, rig: Path | None, *, light: bool) -> str:
    """What textual-serve runs for each browser."""
    words = [sys.executable, "-c", COMMAND, "ui"]
    words += [str(folder.absolute())] if folder is not None else []
    words += ["--rig", str(rig.absolute())] if rig is not None else []
    words += ["--light"] if light else []
    return shlex.join(words)


def serve(folder: Path | None, rig: Path | None, port: int, *, light: bool = False) -> None:
    """Serve until Ctrl-C. Raises OSError where the port is taken."""
    server = TokenServer(command_line(folder, rig, light=light), port, secrets.token_urlsafe(24))
    web.run_app(server.make_app(), host=HOST, port=port, print=None)
