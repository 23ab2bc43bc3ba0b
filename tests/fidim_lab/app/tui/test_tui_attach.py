"""Which service a UI attaches to, and who may see it in a browser."""

import asyncio
import re
import socket

import pytest
import tomli_w
from aiohttp.test_utils import TestClient, TestServer

from fidim_lab.app.cli import run
from fidim_lab.app.dry_run import DryRunOptions
from fidim_lab.app.service.main import prepare
from fidim_lab.app.service.place import Place, held
from fidim_lab.app.tui.find import Finder
from fidim_lab.app.tui.web import COOKIE, TokenServer, command_line, serve
from fidim_lab.app.ui import finder_for
from fidim_lab.app.ui_dry_run import make_spec, rig_table, with_winches
from fidim_lab.data.rig_file import read_rig
from fidim_lab.data.robot_file import write_robot
from fidim_lab.errors import SetupError

TOKEN = "the-token"


@pytest.fixture
def runtime(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    (tmp_path / "fidim").mkdir(mode=0o700)
    return tmp_path / "fidim"


def test_the_only_service_is_found_and_of_several_the_one_of_a_folder(runtime, tmp_path):
    assert "no service is running" in Finder().look().why
    one, two = Place(runtime, "one"), Place(runtime, "two")
    (tmp_path / "b").mkdir()
    with held(one, tmp_path / "a"):
        assert Finder().look().socket == one.socket
        with held(two, tmp_path / "b"):
            assert "several services" in Finder().look().why
            assert finder_for(tmp_path / "b", None).look().socket == two.socket
        assert "no service runs in this folder" in finder_for(tmp_path / "b", None).look().why


def test_a_folder_and_a_rig_are_too_much_and_a_folder_must_be_one(tmp_path):
    with pytest.raises(SetupError, match="not both"):
        finder_for(tmp_path, tmp_path / "rig.toml")
    with pytest.raises(SetupError, match="is no folder"):
        finder_for(tmp_path / "absent", None)


@pytest.mark.parametrize("ring", [3, 4])
def test_a_dry_run_has_a_rig_file_for_any_robot(irma4, cable_ring, ring, tmp_path):
    robot = with_winches(irma4 if ring == 4 else cable_ring(ring))
    write_robot(tmp_path / "robot.toml", robot)
    (tmp_path / "rig.toml").write_text(tomli_w.dumps(rig_table(robot)))
    assert len(read_rig(tmp_path / "rig.toml").winches) == robot.n


def _browse(*steps):
    """Requests to the web UI, one after another; answers each with status and text."""

    async def main():
        server = TokenServer("true", 8420, TOKEN)
        found = []
        app = await server.make_app()
        async with TestClient(TestServer(app)) as client:
            for path, headers in steps:
                headers = {"Host": "127.0.0.1:8420", **headers}
                async with client.get(path, headers=headers, allow_redirects=False) as answer:
                    found.append((answer.status, await answer.text(), answer.headers.get("Set-Cookie", "")))
        return found

    return asyncio.run(main())


def test_without_the_token_nothing_is_served():
    paths = ["/", "/ws", "/static/js/textual.js", "/?token=wrong", "/download/x"]
    wrong = {"Cookie": f"{COOKIE}=wrong"}
    assert [status for status, *_ in _browse(*((path, {}) for path in paths))] == [403] * len(paths)
    assert [status for status, *_ in _browse(*((path, wrong) for path in paths))] == [403] * len(paths)


def test_with_the_token_a_cookie_is_given_that_other_sites_cannot_use():
    [(status, _, cookie)] = _browse((f"/?token={TOKEN}", {}))
    assert status == 302
    assert re.search("HttpOnly", cookie)
    assert re.search("SameSite=Strict", cookie)
    [(status, text, _)] = _browse(("/", {"Cookie": f"{COOKIE}={TOKEN}"}))
    assert status == 200
    assert "textual" in text


def test_another_host_name_is_refused_even_with_the_token():
    [(status, *_)] = _browse((f"/?token={TOKEN}", {"Host": "evil.example:8420"}))
    assert status == 403


def test_the_browser_runs_the_same_ui(tmp_path):
    assert command_line(tmp_path, None, light=True).endswith(f" ui {tmp_path} --light")


def test_a_port_that_is_taken_is_said(tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(SetupError, match="cannot be listened at"):
            serve(tmp_path, None, taken.getsockname()[1])


def test_the_page_asks_no_other_computer_and_keeps_to_the_name_it_was_asked_by():
    cookie = {"Cookie": f"{COOKIE}={TOKEN}"}
    [(_, text, _)] = _browse(("/", {**cookie, "Host": "localhost:8420"}))
    assert 'data-session-websocket-url="ws://localhost:8420/ws"' in text
    assert re.findall(r"https?://", text) == []
    [(_, large, _), (_, wrong, _)] = _browse(("/?fontsize=32", cookie), ("/?fontsize=9999", cookie))
    assert 'data-font-size="32"' in large
    assert 'data-font-size="16"' in wrong


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
