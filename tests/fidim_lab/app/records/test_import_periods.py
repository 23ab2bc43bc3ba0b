"""Tables of times that people write, from file to campaign, and every sentence about a wrong one."""

from pathlib import Path

import pytest
from click.testing import CliRunner

from fidim_lab.app.cli import fidim
from fidim_lab.data.campaign import read_campaign
from fidim_lab.errors import SetupError

ROBOT = Path(__file__).parents[4] / "examples" / "robots" / "bifilar.toml"
NAMES = "motion,l1,l2,swings,time,sd,amplitude,tilt_x,tilt_y,tilt_sd,note"
YAW = "yaw,2.38,2.38,20,53.0,0.1,0.05,0.01,-0.002,0.002,first try"


def imported(folder: Path, text: str, *asked: str, robot: Path = ROBOT) -> tuple[int, str]:
    """Exit code and what was said."""
    (folder / "times.csv").write_text(text, encoding="utf-8")
    arguments = ["import", "periods", str(folder / "times.csv"), "--robot", str(robot), "--out", str(folder / "out")]
    found = CliRunner().invoke(fidim, [*arguments, *asked])
    code = 0 if found.exit_code == 0 else getattr(found.exception, "exit_code", 1)
    hint = getattr(found.exception, "hint", "")
    return code, " ".join(f"{found.output} {found.exception or ''} {hint}".split())


@pytest.mark.parametrize(
    "text",
    [
        f"{NAMES}\n{YAW}\n",
        "# by hand\n\nMotion;l1 (mm);l2 (mm);swings;time (s);sd (ms);amplitude (mrad);tilt_x (deg);tilt_y (°);tilt_sd\n"
        "Yaw;2380;2380;20;53,0;100;50;0,5729578;-0,11459156;0,002\n",
        "swings\tperiod [s]\tsd\tl2\tl1\tmotion\tamplitude\ttilt_x\ttilt_y\ttilt_sd\n"
        "20\t2.65\t0.005\t2.38\t2.38\tyaw\t0.05\t0.01\t-0.002\t0.002\n",
    ],
    ids=["plain", "other units and decimal sign", "one swing"],
)
def test_every_way_to_write_it_is_the_same_period(tmp_path: Path, text: str) -> None:
    code, said = imported(tmp_path, text)
    assert code == 0, said
    (one,) = read_campaign(tmp_path / "out", periods=True).periods
    assert one.lengths == pytest.approx([2.38, 2.38])
    assert (one.motion, one.swings) == ("yaw", 20)
    assert one.time == pytest.approx(53.0)
    assert one.sd == pytest.approx(0.1)
    assert one.amplitude == pytest.approx(0.05)
    assert one.tilt == pytest.approx((0.01, -0.002, 0.002), abs=1e-6)


def test_what_is_not_known_stays_so(tmp_path: Path) -> None:
    code, said = imported(tmp_path, "motion,time,sd\n?,2.65,0.01\n,3.05,0.01\n", "--lengths", "2.38,2.38")
    assert code == 0, said
    first, second = read_campaign(tmp_path / "out", periods=True).periods
    assert (first.motion, second.motion, first.swings) == ("", "", 1)
    assert (first.amplitude, first.tilt) == (None, None)
    with pytest.raises(SetupError, match="show no motion over time"):
        read_campaign(tmp_path / "out")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("motion,l1,l2,swings,time,sd\n", "1 lines that are not blank"),
        (f"{NAMES.replace('swings', 'swing')}\n{YAW}", "line 1, column 4: named 'swing'; allowed are l1, l2"),
        (f"{NAMES.replace('time', 'time (h)')}\n{YAW}", "column 5: unit 'h' of time; allowed are s, ms, min"),
        (f"{NAMES.replace('l2', 'l1')}\n{YAW}", "column 3: l1 stands twice"),
        (f"{NAMES.replace('sd,amplitude', 'note,amplitude').removesuffix(',note')}\n{YAW}", "no column sd"),
        ("motion,time,sd\nyaw,2.65,0.01\n", "no column l1, l2"),
        (f"{NAMES}\n{YAW.replace('yaw', 'twist')}", 'line 2, column 1 (motion): "twist"; allowed are'),
        (f"{NAMES}\n{YAW.replace('53.0', 'fast')}", "line 2, column 5"),
        (f"{NAMES}\n{YAW.replace('53.0', '')}", "line 2, column 5 (time): is missing"),
        (f"{NAMES}\n{YAW.replace('53.0', '-53.0')}", "column 5 (time): -53; more than 0 is allowed"),
        (f"{NAMES}\n{YAW.replace(',20,', ',19.5,')}", "column 4 (swings): 19.5; a whole number is wanted"),
        (f"{NAMES}\n{YAW.replace('0.1,', '9.1,')}", "column 6 (sd): 9.1 s of 53 s; up to a tenth is allowed"),
        (f"{NAMES}\n{YAW.replace('2.38,2.38', '2.38,')}", "column 2 (lengths): 1 lengths for a robot file of 2"),
        (f"{NAMES}\n{YAW.replace('2.38,2.38', '2380,2380')}", "2380 m; up to 100 m is allowed. Are they mm?"),
        (f"{NAMES}\n{YAW.replace('0.05', '12')}", "column 7 (amplitude): 12 rad; up to 1.5 is allowed. Are they deg"),
        (f"{NAMES}\n{YAW.replace(',0.002', ',')}", "column 10 (tilt_sd): is missing beside tilt"),
        (f"{NAMES}\n{YAW},,x", "line 2: 13 cells, the names are 11"),
        (f"{NAMES}\n{YAW.replace(',20,', ',40,')}", "times.csv: line 2: a swing (yaw) takes 1.325 s, 0.5 times"),
    ],
)
def test_wrong_tables_are_told(tmp_path: Path, text: str, said: str) -> None:
    code, found = imported(tmp_path, text)
    assert code == 2, found
    assert said in found
    assert not (tmp_path / "out").exists()


def test_options_that_would_be_ignored_are_refused(tmp_path: Path) -> None:
    assert "and takes --lengths and --takes alone" in imported(tmp_path, f"{NAMES}\n{YAW}", "--axes", "x,y,z")[1]


def test_the_commands_say_what_periods_show(tmp_path: Path) -> None:
    code, said = imported(tmp_path, f"{NAMES}\n{YAW}\nalong,2.38,2.38,20,61.1,0.1,,0.01,-0.002,0.002,\n")
    assert code == 0, said
    out, answer = str(tmp_path / "out"), tmp_path / "r.json"
    found = CliRunner().invoke(fidim, ["identify", out, "--json", str(answer)])
    assert found.exit_code == 0, found.output
    assert '"seen": false' in answer.read_text(encoding="utf-8")
    told = " ".join(found.output.split())
    assert "No amplitude is stated of period 2" in told
    assert "fidim import periods TABLE" in told
    for command in (["explain", out], ["identify", out, "--method", "tls"]):
        refused = CliRunner().invoke(fidim, command)
        assert refused.exit_code != 0
        assert "periods" in str(refused.exception)
