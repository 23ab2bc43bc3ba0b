"""Which service a UI attaches to, and who may see it in a browser."""

import asyncio
import re
import socket

import pytest
import tomli_w
from aiohttp import web
from aiohttp.test_utils import TestClient, TestServer

from fidim_lab.app.cli import run
from fidim_lab.app.service.lock import held
from fidim_lab.app.service.main import prepare
from fidim_lab.app.service.place import ServicePlace
from fidim_lab.app.session.dry_run_plan import DryRunOptions
from fidim_lab.app.session.ui import finder_for
from fidim_lab.app.session.ui_dry_run import make_spec, rig_table, with_winches
from fidim_lab.app.tui.link import Finder
from fidim_lab.app.tui.web import TokenServer, command_line, serve
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.data.robot_file import write_robot
from fidim_lab.errors import SetupError

TOKEN = "the-token"


@pytest.fixture
def runtime(tmp_path, monkeypatch):
    monkeypatch.setenv("FIDIM_RUNTIME_DIR", str(tmp_path))
    return tmp_path


def test_the_only_service_is_found_and_of_several_the_one_of_a_folder(runtime, tmp_path):
    assert "no service is running" in Finder().look().why
    one, two = ServicePlace(runtime, "one"), ServicePlace(runtime, "two")
    (tmp_path / "b").mkdir()
    with held(one, tmp_path / "a"):
        assert Finder().look().socket == one.socket
        with held(two, tmp_path / "b"):
            assert "several services" in Finder().look().why
            assert finder_for(tmp_path / "b", None).look().socket == two.socket
        assert "no service runs in this folder" in finder_for(tmp_path / "b", None).look().why
        assert "r starts it again" not in finder_for(tmp_path / "b", None).look().why, "there was no run in it"
        (tmp_path / "b" / "run.json").write_text("{}")
        assert "r starts it again" in finder_for(tmp_path / "b", None).look().why


def test_a_folder_and_a_rig_are_too_much_and_a_folder_must_be_one(tmp_path):
    with pytest.raises(SetupError, match="not both"):
        finder_for(tmp_path, tmp_path / "rig.toml")
    with pytest.raises(SetupError, match="is not a folder"):
        finder_for(tmp_path / "absent", None)


@pytest.mark.parametrize("ring", [3, 4])
def test_a_dry_run_has_a_rig_file_for_any_robot(irma4, cable_ring, ring, tmp_path):
    robot = with_winches(irma4 if ring == 4 else cable_ring(ring))
    write_robot(tmp_path / "robot.toml", robot)
    (tmp_path / "rig.toml").write_text(tomli_w.dumps(rig_table(robot)))
    assert len(read_rig(tmp_path / "rig.toml").winches) == robot.n


HERE = {"Host": "127.0.0.1:8420", "Origin": "http://127.0.0.1:8420"}
"""as the UI's own page asks"""


def _browse(*steps, command="true"):
    """Requests to the web UI, one after another; answers each with status, text and headers."""

    async def main():
        server = TokenServer(command, 8420, TOKEN)
        found = []
        async with TestClient(TestServer(await server.make_app())) as client:
            for path, headers in steps:
                headers = {"Host": "127.0.0.1:8420", **headers}
                async with client.get(path, headers=headers, allow_redirects=False) as answer:
                    found.append((answer.status, await answer.text(), answer.headers))
        return found

    return asyncio.run(main())


@pytest.fixture
def reached(monkeypatch):
    """Whether who asks like this would get a UI of its own."""

    async def started(self, request):
        return web.Response(status=200)

    monkeypatch.setattr("textual_serve.server.Server.handle_websocket", started)

    def reached(path, headers):
        [(status, *_)] = _browse((path, headers))
        assert status in (200, 403, 404)
        return status == 200

    return reached


def test_the_socket_opens_for_the_page_that_knows_the_token_by_both_names_of_this_computer(reached):
    assert reached(f"/ws/{TOKEN}?width=80&height=24", HERE)
    assert reached(f"/ws/{TOKEN}", {"Host": "localhost:8420", "Origin": "http://localhost:8420"})


@pytest.mark.parametrize("path", ["/ws", "/ws/", "/ws/wrong", "/ws/%ED%A0%80", f"/ws?token={TOKEN}", f"/ws/{TOKEN}/x"])
def test_without_the_token_the_socket_stays_closed_whatever_cookie_comes(path, reached):
    assert not reached(path, {**HERE, "Cookie": f"fidim-ui={TOKEN}; token={TOKEN}"})


@pytest.mark.parametrize(
    "origin",
    [
        "http://127.0.0.1:9999",  # another user's server on this computer
        "http://127.0.0.1",
        "https://127.0.0.1:8420",
        "http://localhost:8420",  # a page asks by the name that it has itself
        "http://evil.example:8420",
        "null",
        "",
    ],
)
def test_no_other_page_opens_the_socket_even_with_the_token(origin, reached):
    assert not reached(f"/ws/{TOKEN}", {**HERE, "Origin": origin})
    assert _browse(("/", {"Origin": origin}), ("/static/js/textual.js", {"Origin": origin}))[0][0] == 403


def test_the_socket_wants_to_know_which_page_asks(reached):
    assert not reached(f"/ws/{TOKEN}", {"Host": "127.0.0.1:8420"})


@pytest.mark.parametrize("host", ["evil.example:8420", "127.0.0.1:9999", "127.0.0.1", "[::1]:8420", "127.0.0.1.:8420"])
def test_a_name_that_was_rebound_to_this_computer_is_refused_on_every_route(host, reached):
    assert not reached(f"/ws/{TOKEN}", {"Host": host, "Origin": f"http://{host}"})
    paths = ("/", "/static/js/textual.js")
    assert [status for status, *_ in _browse(*((path, {"Host": host}) for path in paths))] == [403, 403]


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_another_page_gets_no_part_of_this_one_but_a_link_may_lead_here(site):
    about = {"Sec-Fetch-Site": site}
    script, framed, followed = _browse(
        ("/static/js/textual.js", {**about, "Sec-Fetch-Dest": "script"}),
        ("/", {**about, "Sec-Fetch-Dest": "iframe"}),
        ("/", {**about, "Sec-Fetch-Dest": "document"}),
    )
    assert [script[0], framed[0], followed[0]] == [403, 403, 200]


def test_no_cookie_is_given_and_the_page_holds_no_token():
    for _, text, headers in _browse(("/", {}), (f"/?token={TOKEN}", {}), ("/static/js/textual.js", {})):
        assert "Set-Cookie" not in headers
        assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
        assert TOKEN not in text


def test_what_textual_serve_has_besides_is_not_there():
    assert [status for status, *_ in _browse(("/download/x", {}), ("/static/", {}))] == [404, 403]


def test_the_browser_runs_the_same_ui(tmp_path):
    assert command_line(tmp_path, None, light=True).endswith(f" ui {tmp_path} --light")


def test_a_port_that_is_taken_is_said(tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(SetupError, match="cannot be used"):
            serve(tmp_path, None, taken.getsockname()[1])


def test_the_page_asks_no_other_computer():
    [(status, text, _)] = _browse(("/", {}))
    assert status == 200
    assert re.findall(r"https?://", text) == []


def test_an_effect_that_nobody_knows_is_said_before_anything_starts(runtime, tmp_path, capsys):
    assert run(["dry-run", "--ui", "--hide", "gremlins", "--out", str(tmp_path / "run")]) == 2
    assert "no effect is called 'gremlins'" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
    assert list(runtime.iterdir()) == []


@pytest.mark.parametrize(("command", "instead"), [("ui", "fidim ui --web"), ("dry-run --ui", "fidim dry-run without")])
def test_without_a_terminal_it_is_said_what_to_use_instead(command, instead, runtime, tmp_path, capsys):
    few = ["--equilibria", "1", "--validate", "0", "--out", str(tmp_path / "run")] if "dry-run" in command else []
    assert run([*command.split(), *few]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "needs a terminal" in said
    assert f"Use {instead}" in said
    assert list(runtime.iterdir()) == []


@pytest.mark.parametrize(("excite", "procedure"), [(False, "identify"), (True, "excite")])
def test_a_rehearsal_by_keys_runs_the_procedure_that_was_asked_for(excite, procedure, tmp_path):
    options = DryRunOptions(None, 1, None, 1, 0, (), True, None, ui=True, excite=excite)
    spec = make_spec(options, tmp_path / "run", tmp_path)
    assert spec.procedure == procedure
    assert prepare(spec).experiment.roles
