"""Robot files that read well and are wrong all the same: each mistake is found, with a number, and right ones pass."""

import itertools
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fidim_lab.app import cli
from fidim_lab.app.doctor.robot_findings import RobotFinding
from fidim_lab.app.doctor.robot_plausibility import middle_rests, plausibility
from fidim_lab.app.doctor.robot_text import robot_views
from fidim_lab.app.report.drawings.robot_picture import robot_picture
from fidim_lab.data.records import Body, Cable, Limits, Robot, Survey
from fidim_lab.data.robot_file import PAPERS_ROBOT, read_robot, write_robot
from fidim_lab.errors import FileError
from fidim_lab.model.mechanism import Mechanism


def _by_name(robot: Robot) -> dict[str, RobotFinding]:
    return {finding.what: finding for finding in plausibility(robot)}


def _with(robot: Robot, cable: int, **changes: Any) -> Robot:
    cables = [replace(one, **changes) if k == cable else one for k, one in enumerate(robot.cables)]
    return replace(robot, cables=tuple(cables))


def _meeting_cables(width: float) -> Robot:
    """Four cables whose pulleys point radially and which meet in a square of this width (as IRMA4U's do)."""
    cables = tuple(
        Cable(
            d=np.array([1.068 * x, 1.155 * y, 1.839]),
            a=np.array([width / 2 * x, width / 2 * y, 0.28]),
            radius=0.03,
            x=np.array([0.0, 0.0, -1.0]),
            y=np.array([0.0, 1.0 * x, 0.0]),
            z=np.array([1.0 * x, 0.0, 0.0]),
        )
        for x, y in ((1, -1), (1, 1), (-1, 1), (-1, -1))
    )
    body = Body(np.array([0.0, 0.0, 0.173]), np.array([0.0441, 0.0388, 0.0144, 0.0, 0.0, 0.0]))
    return Robot(cables, 12.966, body, np.zeros(3), limits=Limits((5.0, 300.0)))


def test_the_papers_robot_is_plausible(irma4: Robot):
    findings = plausibility(irma4)
    assert [f.what for f in findings] == [
        "units",
        "attachments",
        "copies",
        "roll",
        "inertia",
        "body",
        "weight",
        "uncertainties",
        "rest",
        "order",
        "pulleys",
        "soft modes",
        "frequencies",
    ]
    assert all(f.ok and not f.advice for f in findings), [f for f in findings if not f.ok or f.advice]
    # every finding is a sentence with a number
    for finding in findings:
        assert finding.found[0].isupper() or finding.found[0].isdigit()
        assert finding.found.endswith(".")
        assert any(character.isdigit() for character in finding.found)


@pytest.mark.parametrize("n", [2, 3, 5])
def test_other_robots_are_not_refused(n, cable_ring):
    assert all(finding.ok for finding in plausibility(cable_ring(n)))


def test_millimetres_stop_everything_else(irma4: Robot):
    cables = tuple(replace(c, d=1000 * c.d, a=1000 * c.a, radius=1000 * c.radius) for c in irma4.cables)
    findings = plausibility(replace(irma4, cables=cables))
    assert [(f.what, f.ok) for f in findings] == [("units", False)]
    assert findings[0].found == "Cable 2, d holds 2295, which would be metres."
    assert "millimetres" in findings[0].advice


def test_a_pulley_in_millimetres(irma4: Robot):
    cables = tuple(replace(c, radius=25.0) for c in irma4.cables)
    (finding,) = plausibility(replace(irma4, cables=cables))
    assert not finding.ok
    assert "radius is 25 m" in finding.found


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("marker_noise", 0.1, "marker_noise is 0.1 m, and the largest swing"),
        ("encoder_resolution", 0.2, "encoder_resolution is 0.2 m, and a turn of the motor"),
        ("anchor", 5.0, "anchor is 5 m, and two anchors are"),
        ("attachment", 0.5, "attachment is 0.5 m, and two attachments are"),
        ("marker", 0.5, "marker is 0.5 m, and two markers are"),
        ("encoder_zero", 5.0, "encoder_zero is 5 m, and an anchor"),
        ("frame_shift", 5.0, "frame_shift is 5 m, and an anchor"),
        ("radius", 0.2, "radius is 0.2 m, and the largest pulley"),
        ("axis", 5.0, "axis is 5 rad"),
        ("frame_rotation", 2.0, "frame_rotation is 2 rad"),
        ("gravity", 2.0, "gravity is 2 rad"),
    ],
)
def test_standard_deviations_in_another_unit(irma4: Robot, key: str, value: float, says: str):
    seen = replace(irma4, extra_markers=(np.array([0.1, 0.0, 0.2]), np.array([0.0, 0.12, 0.2])))
    if key in {"marker_noise", "encoder_resolution"}:
        wrong = replace(seen, sensors=replace(seen.sensors, **{key: value}))
    else:
        survey = Survey.alike(seen.n, 2e-3, 5e-4)
        size = np.full((seen.n, 3), value) if key in {"anchor", "attachment"} else value
        wrong = replace(seen, survey=replace(survey, **{key: size}))
    found = _by_name(wrong)["uncertainties"]
    assert not found.ok
    assert says in found.found
    assert "m and rad" in found.advice


def test_attachments_in_the_world_frame(irma4: Robot):
    cables = tuple(replace(c, a=c.a + np.array([1.2, -0.2, 0.0])) for c in irma4.cables)
    finding = _by_name(replace(irma4, cables=cables))["attachments"]
    assert not finding.ok
    assert "attachment of cable 2, 1.411 m" in finding.found
    assert "body frame" in finding.advice


def test_inertia_that_is_not_per_unit_mass(irma4: Robot):
    nominal = replace(irma4.nominal, inertia=irma4.mass * irma4.nominal.inertia)
    found = _by_name(replace(irma4, nominal=nominal))
    assert not found["inertia"].ok
    assert "looks like kg m²: divide it by 11" in found["inertia"].advice
    assert found["rest"].ok


def test_inertia_about_the_wrong_point(irma4: Robot):
    about_com = irma4.nominal.inertia_about_com
    nominal = replace(irma4.nominal, inertia=np.array([*np.diag(about_com), 0.0, 0.0, 0.0]))
    found = _by_name(replace(irma4, nominal=nominal))
    assert not found["body"].ok
    assert "one is not positive" in found["body"].found
    assert "about P" in found["body"].advice
    assert "frequencies" not in found  # such a body has none


def test_the_triangle_inequality(irma4: Robot):
    nominal = Body(np.zeros(3), np.array([0.01, 0.01, 0.04, 0.0, 0.0, 0.0]))
    assert "the sum of the others" in _by_name(replace(irma4, nominal=nominal))["body"].found


@pytest.mark.parametrize(
    ("mass", "limits", "says"), [(110.0, (20.0, 200.0), "cannot carry it"), (11.0, (120.0, 500.0), "whole weight")]
)
def test_tension_limits_against_the_weight(irma4: Robot, mass: float, limits: tuple[float, float], says: str):
    finding = _by_name(replace(irma4, mass=mass, limits=Limits(limits)))["weight"]
    assert not finding.ok
    assert says in finding.advice
    assert f"{mass * 9.81:.1f} N" in finding.found


def test_tension_limits_that_no_rest_keeps(irma4: Robot):
    finding = _by_name(replace(irma4, limits=Limits((190.0, 192.0))))["rest"]
    assert not finding.ok
    assert "taut cables in their limits" in finding.found


def test_cables_in_the_wrong_order_have_no_rest(irma4: Robot):
    attachments = [irma4.cables[k].a for k in (2, 3, 0, 1)]
    cables = tuple(replace(c, a=a) for c, a in zip(irma4.cables, attachments, strict=True))
    finding = _by_name(replace(irma4, cables=cables))["rest"]
    assert not finding.ok
    assert "in this order it rests" in finding.advice


@pytest.mark.parametrize(("cable", "like"), list(itertools.permutations(range(4), 2)))
def test_axes_copied_from_another_cable_are_seen(cable: int, like: int, irma4: Robot):
    other = irma4.cables[like]
    advice = _by_name(_with(irma4, cable, x=other.x, y=other.y, z=other.z))["pulleys"].advice
    assert f"able {cable + 1}" in advice
    assert f"those of cable {like + 1}" in advice


@pytest.mark.parametrize("cable", range(4))
def test_an_axis_turned_round_is_seen(cable: int, irma4: Robot):
    own = irma4.cables[cable]
    advice = _by_name(_with(irma4, cable, x=-own.x, z=-own.z))["pulleys"].advice
    assert f"Cable {cable + 1} turns by" in advice
    assert "turned round" in advice


def test_a_cable_that_leaves_its_pulley_backwards(irma4: Robot):
    # the swivel axis passes nearer to the attachment than the pulley is wide
    rest = middle_rests(Mechanism(irma4))
    attachment = rest[len(rest) // 2].pose.position + irma4.cables[0].a
    up, x = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    robot = _with(irma4, 0, d=attachment + np.array([0.01, 0.0, 1.0]), radius=0.3, x=x, y=np.cross(up, x), z=up)
    finding = _by_name(robot).get("pulleys")
    assert finding is not None
    assert not finding.ok
    assert "Cable 1 leaves its pulley backwards" in finding.advice


def test_a_table_that_was_copied(irma4: Robot):
    finding = _by_name(_with(irma4, 2, d=irma4.cables[1].d))["copies"]
    assert not finding.ok
    assert "Cables 2 and 3 have the same d" in finding.found


def test_attachments_on_a_line_leave_a_roll(irma4: Robot):
    robot = irma4
    for k, cable in enumerate(irma4.cables):
        robot = _with(robot, k, a=np.array([0.0, cable.a[1], 0.27]))
    finding = _by_name(robot)["roll"]
    assert finding.ok
    assert "attachments (a) lie on one line" in finding.advice


@pytest.mark.parametrize(
    ("factor", "unit"), [(11.0, "kg m²"), (11e6, "kg mm²"), (1e6, "mm² per unit mass"), (11e9, "g mm²")]
)
def test_the_unit_of_an_inertia_is_named(factor: float, unit: str, irma4: Robot):
    nominal = replace(irma4.nominal, inertia=factor * irma4.nominal.inertia)
    assert (
        f"It looks like {unit}: divide it by {factor:g}" in _by_name(replace(irma4, nominal=nominal))["inertia"].advice
    )


def test_six_cables_are_refused_with_the_reason(tmp_path: Path):
    path = tmp_path / "six.toml"
    cable = PAPERS_ROBOT.read_text().partition("[[cable]]")[2].partition("[[cable]]")[0]
    path.write_text(PAPERS_ROBOT.read_text() + 2 * f"\n[[cable]]{cable}")
    with pytest.raises(FileError, match="6 cables of held length leave the platform no freedom"):
        read_robot(path)


def test_the_robot_is_drawn_true_to_scale(irma4: Robot):
    rests = middle_rests(Mechanism(irma4))
    lines = robot_views(irma4, rests[len(rests) // 2]).splitlines()
    assert "0.05 … 2.29 m, -1.32 … 0.97 m" in lines[1]
    above = [line[:30].rstrip() for line in lines[2:-1]]
    place = {sign: (row.index(sign), k) for k, row in enumerate(above) for sign in "1234" if sign in row}
    assert sorted(place) == ["1", "2", "3", "4"]
    # a letter is twice as tall as wide: 2.24 m in x and 2.29 m in y
    scale = (place["2"][0] - place["4"][0]) / (2.295 - 0.0532)
    assert 2 * (place["1"][1] - place["3"][1]) / (0.973 + 1.316) == pytest.approx(scale, rel=0.1)
    assert max(map(len, lines)) <= 80


def test_the_drawing_of_the_docs_says_what_it_says_now(irma4: Robot):
    rests = middle_rests(Mechanism(irma4))
    drawn = robot_picture(irma4, rests[len(rests) // 2])
    kept = (Path(__file__).parents[4] / "docs" / "pictures" / "robot.svg").read_text(encoding="utf-8")
    texts = re.findall(r"<text[^>]*>([^<]*)</text>", drawn)
    assert {"D1", "A1", "P", "G", "B", "marker", "from the winch"} <= set(texts)
    assert re.findall(r"<text[^>]*>([^<]*)</text>", kept) == texts, (
        "fidim doctor --robot irma4 --picture docs/pictures/robot.svg"
    )


def test_cables_that_meet_are_soft_and_wide_ones_are_not():
    soft = _by_name(_meeting_cables(0.15))["soft modes"]
    assert soft.ok  # such a robot exists
    assert "0.3 mm of stretch turns it" in soft.found
    assert "Rigid cables are the wrong model" in soft.advice


def test_a_tiny_inertia_swings_faster_than_the_filter_lets_through(irma4: Robot):
    com = np.array([0.0, 0.0, 0.0])
    nominal = Body(com, np.array([1e-4, 1e-4, 1e-4, 0.0, 0.0, 0.0]))
    finding = _by_name(replace(irma4, nominal=nominal))["frequencies"]
    assert finding.advice
    assert "Hz" in finding.found


def _in_order(robot: Robot, order: tuple[int, ...]) -> Robot:
    return replace(
        robot, cables=tuple(replace(one, a=robot.cables[k].a) for one, k in zip(robot.cables, order, strict=True))
    )


@pytest.mark.sampled(8)
@pytest.mark.parametrize("order", list(itertools.permutations(range(4)))[1:])
def test_attachments_in_any_other_order_than_the_anchors_are_seen(irma4: Robot, order: tuple[int, ...]):
    found = _by_name(_in_order(irma4, order))
    says = found["rest"].advice + (found["order"].advice if "order" in found else "")
    assert "in this order it rests" in says or "that of the same cable's d" in says


def test_gravity_along_another_axis_is_named(irma4: Robot):
    finding = _by_name(replace(irma4, gravity=np.array([0.0, -9.81, 0.0])))["rest"]
    assert "With gravity = [0, 0, -9.81] it rests" in finding.advice


@pytest.mark.parametrize(
    ("gravity", "says"), [((0.0, 0.0, 9.81), "gravity points along +z"), ((0.0, 0.0, -9810.0), "gravity is 9810 m/s²")]
)
def test_unusual_gravity_is_warned_of(irma4: Robot, gravity: tuple[float, ...], says: str):
    limits = Limits((5.0, 3e5))
    assert says in _by_name(replace(irma4, gravity=np.array(gravity), limits=limits))["weight"].advice


def test_a_wide_platform_below_a_wider_frame_is_only_unusual(irma4: Robot):
    wide = replace(irma4, cables=tuple(replace(one, d=5.0 * one.d, a=5.0 * one.a) for one in irma4.cables))
    finding = _by_name(wide)["attachments"]
    assert finding.ok
    assert "wider than a metre is unusual" in finding.advice


def test_a_dry_run_of_a_robot_file_in_millimetres_says_so_before_it_plans(irma4: Robot, tmp_path: Path, capsys):
    file = tmp_path / "robot.toml"
    write_robot(file, replace(irma4, cables=tuple(replace(one, d=1e3 * one.d) for one in irma4.cables)))
    for command in ("dry-run", "simulate"):
        assert cli.run([command, "--robot", str(file), "--out", str(tmp_path / command)]) == 2
        assert "Lengths are in metres: divide millimetres by 1000" in capsys.readouterr().err
        assert not (tmp_path / command).exists()
