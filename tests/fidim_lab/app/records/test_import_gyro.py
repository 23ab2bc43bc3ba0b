"""A phone on a pendulum, from what apps export to a campaign: dialects, hands, wrong units, axes and stamps."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from benchmarks.identification.phone import PhoneNoise, PhoneRecording, as_phyphox, as_sensor_logger, record_phone
from fidim_lab.app.cli import fidim
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.own_sensors import angular_rates
from fidim_lab.data.robot_file import read_robot
from fidim_lab.identification.motion.free_swing import free_swings
from sim_backends.plant.world import make_world

ROBOT = Path(__file__).parents[4] / "examples" / "robots" / "bifilar.toml"
LENGTHS = ("--lengths", "2.38,2.38")
STRAIGHT = np.zeros(4)


@pytest.fixture(scope="module")
def swing() -> PhoneRecording:
    """3 s in the hand, then 12 s of free swing; the phone sits straight."""
    rng = np.random.default_rng(7)
    world = make_world(read_robot(ROBOT), rng)
    return record_phone(world, np.array([2.38, 2.38]), np.array([0.04, 0.05]), 12.0, rng, PhoneNoise(), STRAIGHT)


def imported(folder: Path, text: str, *asked: str) -> tuple[int, str]:
    """Exit code and what was said."""
    (folder / "swing.csv").write_text(text, encoding="utf-8")
    found = CliRunner().invoke(
        fidim,
        ["import", "gyro", str(folder / "swing.csv"), "--robot", str(ROBOT), "--out", str(folder / "out"), *asked],
    )
    code = 0 if found.exit_code == 0 else getattr(found.exception, "exit_code", 1)
    hint = getattr(found.exception, "hint", "")
    return code, " ".join(f"{found.output} {found.exception or ''} {hint}".split())


DIALECTS: dict[str, Callable[[PhoneRecording], str]] = {
    "phyphox": as_phyphox,
    "phyphox, comma": lambda found: as_phyphox(found, comma=True),
    "phyphox, degrees": lambda found: as_phyphox(found, degrees=True),
    "Sensor Logger": as_sensor_logger,
}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_every_dialect_gives_the_same_window_without_the_hand(
    swing: PhoneRecording, tmp_path: Path, dialect: str
) -> None:
    code, said = imported(tmp_path, DIALECTS[dialect](swing), *LENGTHS)
    assert code == 0, said
    campaign = read_campaign(tmp_path / "out")
    assert [window.id for window in campaign.windows] == ["w1"]
    window = campaign.windows[0]
    assert 11.0 < window.duration < 12.0  # none of the 3 s in the hand
    assert window.lengths is not None
    assert np.all(window.lengths == 2.38)
    assert campaign.robot.sensors.gyro_noise == pytest.approx(2e-3, rel=0.2)  # 4e-3 of four samples in 20 ms
    rates = angular_rates(window)
    near = np.array([np.interp(window.t + swing.t[0], swing.t, swing.rates[:, k]) for k in range(3)]).T
    assert np.abs(rates - near)[np.isfinite(rates)].max() < 0.025  # six times the noise of a sample
    assert "came twice" in said


@pytest.mark.parametrize("tremor", [0.0, 0.008, 0.015, 0.1])
def test_steady_and_unsteady_hands_are_left_out(tmp_path: Path, tremor: float) -> None:
    rng = np.random.default_rng(9)
    noise = PhoneNoise(tremor=tremor, held=4.0)
    world = make_world(read_robot(ROBOT), rng)
    found = record_phone(world, np.array([2.38, 2.38]), np.array([0.05, 0.04]), 12.0, rng, noise, STRAIGHT)
    code, said = imported(tmp_path, as_phyphox(found), *LENGTHS)
    assert code == 0, said
    window = read_campaign(tmp_path / "out").windows[0]
    assert 3.95 < window.t[0] < 5.0
    assert window.t[-1] > 15.3


def test_turned_axes_are_named(swing: PhoneRecording, tmp_path: Path) -> None:
    upright = replace(swing, rates=swing.rates[:, [1, 2, 0]])  # x of the body is the phone's z, y its x, z its y
    code, said = imported(tmp_path, as_phyphox(upright), *LENGTHS)
    assert code == 1
    assert "not what these cables let turn" in said
    assert "--axes=z,x,y" in said
    code, said = imported(tmp_path, as_phyphox(upright), *LENGTHS, "--axes", "z,x,y")
    assert code == 0, said


def test_a_wrong_unit_is_named(swing: PhoneRecording, tmp_path: Path) -> None:
    wrong = as_phyphox(swing, degrees=True).replace("°/s", "rad/s")
    code, said = imported(tmp_path, wrong, *LENGTHS)
    assert code == 1
    assert "--unit deg/s" in said
    code, said = imported(tmp_path, wrong, *LENGTHS, "--unit", "deg/s")
    assert code == 0, said


def test_stamps_of_packets_are_refused(swing: PhoneRecording, tmp_path: Path) -> None:
    packets = replace(swing, t=np.floor(swing.t / 0.1) * 0.1 + 1e-4 * (np.arange(len(swing.t)) % 20))
    code, said = imported(tmp_path, as_phyphox(replace(packets, t=np.maximum.accumulate(packets.t))), *LENGTHS)
    assert code == 2
    assert "bunches" in said


def test_a_saturated_axis_is_not_taken_for_motion(swing: PhoneRecording, tmp_path: Path) -> None:
    top = 0.8 * float(np.abs(swing.rates).max())
    code, said = imported(tmp_path, as_phyphox(replace(swing, rates=np.clip(swing.rates, -top, top))), *LENGTHS)
    assert "saturates" in said or "saturated" in said
    if code == 0:
        rates = angular_rates(read_campaign(tmp_path / "out").windows[0])
        assert np.nanmax(np.abs(rates)) < top


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ((), "--lengths"),
        (("--lengths", "2.38"), "not 2 lengths"),
        (("--lengths", "0.02,0.02"), "--lengths"),
        ((*LENGTHS, "--axes", "x,y,-z"), "right-handed"),
        ((*LENGTHS, "--unit", "mm"), "not a unit of angular rates"),
        ((*LENGTHS, "--up", "y"), "takes --axes"),
    ],
)
def test_what_is_asked_wrongly_is_said(
    swing: PhoneRecording, tmp_path: Path, asked: tuple[str, ...], says: str
) -> None:
    code, said = imported(tmp_path, as_phyphox(swing), *asked)
    assert code == 2
    assert says in said
    assert not (tmp_path / "out").exists()


def test_accelerations_are_no_rates(swing: PhoneRecording, tmp_path: Path) -> None:
    code, said = imported(tmp_path, as_phyphox(swing).replace("Gyroscope", "Acceleration"), *LENGTHS)
    assert code == 2
    assert "no angular rates" in said


def test_a_phone_in_the_hand_all_the_time_holds_no_swing() -> None:
    rng = np.random.default_rng(8)
    t = np.arange(0, 20, 0.02)
    hand = np.cumsum(rng.normal(size=(len(t), 3)), axis=0) * 0.02 + 0.05 * np.sin(2 * np.pi * 9 * t)[:, np.newaxis]
    still = 2e-3 * rng.normal(size=(len(t), 3))
    assert free_swings(t, still) == ()
    assert not any((s.last - s.first) > len(t) / 2 for s in free_swings(t, hand * (1 + rng.uniform(0, 2, (len(t), 1)))))
