"""`fidim replay` on a rehearsal: agreement on the same bytes, and the first difference named on others."""

import asyncio
import json
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from drivers.cia402.dictionary import GENERIC_EDS, WinchConfig
from drivers.mocap.decoders import MarkerObjects, MarkerTextDecoder, Upright, ViconUdpDecoder, describe
from drivers.mocap.decoders.vicon_udp import SubjectPoints
from drivers.mocap.packet_log import PacketLog, read_packets
from drivers.ports import DriveState, MarkerFrame, WinchSample
from fidim_lab.app.cli import run
from fidim_lab.app.formats.devices_file import (
    DEVICES,
    Devices,
    DriveObject,
    GradeLine,
    WinchDevices,
    _read_again,
    read_devices,
    write_devices,
)
from fidim_lab.app.formats.manifest import verify
from fidim_lab.app.records.replay import Expected


@pytest.fixture(scope="module")
def rehearsed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("replay") / "run"
    assert run(["dry-run", "--equilibria", "1", "--validate", "0", "--out", str(folder)]) == 0
    return folder


@pytest.fixture
def folder(rehearsed, tmp_path):
    shutil.copytree(rehearsed, tmp_path / "run")
    return tmp_path / "run"


def test_a_run_replays_as_it_was_recorded(rehearsed, tmp_path, capsys):
    assert run(["replay", str(rehearsed), "--json", str(tmp_path / "r.json")]) == 0
    assert "agrees" in capsys.readouterr().out
    table = json.loads((tmp_path / "r.json").read_text())
    assert table["agrees"]
    assert table["markers"] == 1001
    assert table["samples"] > 4 * 1000
    assert table["counters"]["malformed"] == 0


def _recorded(value):
    return SimpleNamespace(window="w1", t=71619.592526, value=value)


def test_a_time_half_way_between_two_microseconds_is_found_whichever_way_it_was_rounded():
    frame = MarkerFrame(71619.5925267, 7112, ((1.0, 2.0, 3.0),))
    expected = Expected(rows={(7112, 71619592526): _recorded([1.0, 2.0, 3.0])})
    assert expected.marker(frame) == ""
    assert expected.marker(frame) is None  # it comes out once
    other = Expected(rows={(7112, 71619592524): _recorded([1.0, 2.0, 3.0])})
    assert other.marker(frame) is None


def test_whether_it_has_arrived_is_compared_only_where_the_drive_says_so():
    sample = WinchSample(1.0, DriveState.OPERATION_ENABLED, 1.5, 0.0, 2.0, False)

    def found(arrival):
        before = SimpleNamespace(length=1.5, velocity=0.0, current=2.0, target_reached=True)
        return Expected(samples={(0, 1_000_000): _recorded(before)}).sample(0, sample, arrival=arrival)

    assert found(arrival=False) == ""
    assert "target reached" in found(arrival=True)


def test_the_manifest_of_a_run_holds(rehearsed):
    found = verify(rehearsed)
    assert found.intact, found
    assert found.checked >= 10


def test_drive_parameters_before_and_after(rehearsed):
    devices = read_devices(rehearsed)
    assert len(devices.winches) == 4
    parameters = {p.object: p for p in devices.winches[0].parameters}
    assert parameters["605A:0"].before == parameters["605A:0"].after == "6"
    assert all(p.after is not None for p in parameters.values())
    assert devices.markers.decoder.objects == ("marker1",)


def test_a_drive_that_is_known_to_be_silent_is_not_asked_afterwards():
    """Each question to it would last as long as its time-outs: half a minute after a run, on a rig of patient ones."""

    class Sdo:
        asked = 0

        async def read(self, index: int, sub: int) -> int:
            self.asked += 1
            return 6

    class Winch:
        def __init__(self, state: DriveState | None) -> None:
            self.link = SimpleNamespace(sdo=Sdo())
            self.sample = None if state is None else SimpleNamespace(state=state)

        def latest(self) -> Any:
            return self.sample

    entry = WinchDevices(None, (DriveObject("605A:0", "quick stop option", "6", "6"),))  # type: ignore[arg-type]
    for state, after in ((DriveState.QUICK_STOP_ACTIVE, "6"), (DriveState.UNKNOWN, None), (None, None)):
        winch: Any = Winch(state)
        found = asyncio.run(_read_again(winch, entry))
        assert found.parameters[0].after == after
        assert winch.link.sdo.asked == (after is not None)


def test_another_scale_is_found_and_named(folder, capsys):
    table = json.loads((folder / DEVICES).read_text())
    table["winches"][2]["config"]["home_length"] += 1e-4
    (folder / DEVICES).write_text(json.dumps(table))
    assert run(["replay", str(folder)]) == 1
    said = capsys.readouterr().out
    assert "windows/i01.mcap, winch 3: length was" in said


def test_a_real_bus_takes_a_sync_after_the_control_loop_has_dated_it(folder, capsys):
    """In real time the log says when the bus took a frame, some ten µs after the instant that dates samples."""
    log = folder / "raw" / "can.log"
    lines = [line.split(" ", 1) for line in log.read_text().splitlines(keepends=True)]
    later = [f"({float(t[1:-1]) + 7e-5 + 3e-4 * (k % 5 == 0):017.6f}) {rest}" for k, (t, rest) in enumerate(lines)]
    log.write_text("".join(later))
    assert run(["replay", str(folder)]) == 0
    assert "agrees" in capsys.readouterr().out


def test_a_sync_belongs_to_the_newest_instant_after_the_last_one():
    expected = Expected(syncs=(1.0, 1.01, 1.03))
    assert [expected.sync(t) for t in (0.9, 1.00007, 1.0109, 1.02004, 1.031, 1.04)] == [
        0.9,
        1.0,
        1.01,
        1.02004,
        1.03,
        1.04,
    ]
    exact = Expected(syncs=(1.0000004, 1.0099996))  # the log has whole µs
    assert [exact.sync(t) for t in (1.0, 1.01, 1.02)] == [1.0000004, 1.0099996, 1.02]


def test_a_frame_that_is_not_in_the_log_is_missed(folder, capsys):
    log = folder / "raw" / "can.log"
    lines = log.read_text().splitlines(keepends=True)
    removed = next(k for k in range(len(lines) - 2000, len(lines)) if " 181#" in lines[k])
    log.write_text("".join(lines[:removed] + lines[removed + 1 :]))
    assert run(["replay", str(folder)]) == 1
    assert "a sample of winch 1 was recorded, the raw bytes do not give it" in capsys.readouterr().out


def test_a_changed_packet_is_found(folder, capsys):
    path = folder / "raw" / "mocap.mcap"
    packets = list(read_packets(path))
    log = PacketLog(path)
    changed = len(packets) - 500
    for k, packet in enumerate(packets):
        data = bytearray(packet.data)
        if k == changed:
            data[37] ^= 0x10  # high in the mantissa of the first coordinate
        log.write(packet.t, packet.connection, bytes(data))
    log.close()
    assert run(["replay", str(folder)]) == 1
    said = capsys.readouterr().out
    assert "windows/i01.mcap" in said
    assert "x of marker 1 was" in said


def test_what_is_needed_is_asked_for(folder, capsys):
    (folder / "raw" / "can.log").unlink()
    assert run(["replay", str(folder)]) == 2
    assert "no raw CAN log" in capsys.readouterr().err
    (folder / DEVICES).unlink()
    assert run(["replay", str(folder)]) == 2
    assert "devices.json" in capsys.readouterr().err


@pytest.mark.parametrize(
    "decoder",
    [
        MarkerTextDecoder(3),
        Upright(MarkerTextDecoder(1)),
        ViconUdpDecoder(MarkerObjects(("a", "b"))),
        Upright(ViconUdpDecoder(SubjectPoints("platform", ((0.1, 0.2, 0.3),)))),
    ],
)
def test_a_decoder_is_described_and_made_again(decoder):
    description = describe(decoder)
    assert describe(description.make()) == description


def test_a_packet_log_that_was_cut_off_keeps_what_was_flushed(tmp_path):
    path = tmp_path / "mocap.mcap"
    log = PacketLog(path)
    for k in range(100):
        log.write(0.01 * k, 1, bytes([k]))
    cut = path.read_bytes()  # as a killed process leaves it
    log.close()
    assert [p.data[0] for p in read_packets(path)] == list(range(100))
    path.write_bytes(cut)
    kept = list(read_packets(path))
    assert 90 <= len(kept) < 100
    assert kept[7].t == pytest.approx(0.07)
    assert kept[7].connection == 1


def test_the_notebook_runs_cell_by_cell(rehearsed, monkeypatch):
    """Without Jupyter: what its code cells say, in order, in one namespace."""
    notebook = json.loads((Path(__file__).parents[4] / "examples" / "campaign.ipynb").read_text())
    monkeypatch.setenv("FIDIM_CAMPAIGN", str(rehearsed))
    names: dict[str, Any] = {}
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), cell["id"], "exec"), names)
    assert names["log"].complete
    assert names["table"].shape == (1001, 14)
    assert names["swings"].loc["i01", "mm"] > 1.0
    assert 0.2 < names["swings"].loc["i01", "Hz"] < 5.0
    assert 5.0 < names["tension"].min() < names["tension"].max() < 250.0
    assert any("record" in text for text in names["events"])


def test_the_dictionary_of_a_makers_drive_goes_with_the_run(tmp_path):
    eds = tmp_path / "maker.eds"
    eds.write_bytes(GENERIC_EDS.read_bytes())
    values = {"counts_per_turn": 4096.0, "drum_radius": 0.03, "rated_current": 5.0, "current_limit": 6.0}
    values |= {"max_speed": 0.3, "max_acceleration": 1.0, "length_limits": (0.3, 3.0)}
    config = WinchConfig(name="winch 1", node_id=7, eds=eds, **values)
    grade = GradeLine("speed limit", "good to have", "configured", "607F:0")
    folder = tmp_path / "run"
    folder.mkdir()
    write_devices(folder, Devices((WinchDevices(config, (), (grade,)),), None))
    eds.unlink()
    [found] = read_devices(folder).winches
    assert found.config == config.changed(eds=folder / "eds" / "node7.eds")
    assert found.config.eds.read_bytes() == GENERIC_EDS.read_bytes()
    assert found.grades == (grade,)
