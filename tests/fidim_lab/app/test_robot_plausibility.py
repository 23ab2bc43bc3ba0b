"""Robot files that read well and are wrong all the same: each mistake is found, with a number, and right ones pass."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.app.doctor.robot_plausibility import Finding, plausibility
from fidim_lab.data.records import Body, Cable, Limits, Robot


def _by_name(robot: Robot) -> dict[str, Finding]:
    return {finding.what: finding for finding in plausibility(robot)}


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
        "inertia",
        "body",
        "weight",
        "rest",
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
    assert "divide kg m² by the mass" in found["inertia"].advice
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
    assert "order of the cables" in finding.advice


def test_cables_that_meet_are_soft_and_wide_ones_are_not():
    soft = _by_name(_meeting_cables(0.15))["soft modes"]
    assert soft.ok  # such a robot exists
    assert "0.3 mm of stretch turns the platform" in soft.found
    assert "rigid" in soft.advice


def test_a_tiny_inertia_swings_faster_than_the_filter_lets_through(irma4: Robot):
    com = np.array([0.0, 0.0, 0.0])
    nominal = Body(com, np.array([1e-4, 1e-4, 1e-4, 0.0, 0.0, 0.0]))
    finding = _by_name(replace(irma4, nominal=nominal))["frequencies"]
    assert finding.advice
    assert "Hz" in finding.found
