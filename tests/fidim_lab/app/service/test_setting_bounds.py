"""`--set`: each setting has its bounds, and no guard goes farther by it than in a rig file."""

from dataclasses import fields

import pytest

from fidim_lab.app.formats.run_spec import number_type, numbers, overridden
from fidim_lab.data.rigs.rig_guard_tables import GuardsTable
from fidim_lab.errors import SetupError
from procedures.settings import ReleaseSettings, Settings

ALL = Settings(release=ReleaseSettings())
SETTABLE = [
    (field.name, name, value) for field in fields(ALL) for name, value in numbers(getattr(ALL, field.name)).items()
]
GUARDS = {
    "sample_age": ("stale_winch", "age"),
    "slack": ("tension", "slack"),
    "overload": ("tension", "overload"),
    "hysteresis": ("tension", "hysteresis"),
    "tension_for": ("tension", "lasting"),
    "slack_handled": ("tension", "handled"),
    "marker_for": ("marker", "lasting"),
    "motion": ("motion", "allowed"),
    "motion_late": ("motion", "late"),
    "motion_speed": ("motion", "speed"),
    "motion_speed_for": ("motion", "lasting"),
    "geometry": ("geometry", "allowed"),
    "slip": ("slip", "allowed"),
    "following_error_for": ("following_error", "lasting"),
    "temperature": ("temperature", "limit"),
    "temperature_hysteresis": ("temperature", "hysteresis"),
    "temperature_age": ("temperature", "age"),
    "bus_lost": ("bus_errors", "lost"),
    "loop_late": ("host_loop", "late"),
    "disk_spare": ("disk", "spare"),
}
BOUNDS = ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum")


@pytest.mark.parametrize(
    ("key", "value", "allowed"),
    [
        ("guard.overload", 100, "a number ≥ 1, ≤ 3"),
        ("guard.slack", -100, "a number ≥ 0, < 1"),
        ("guard.sample_age", 1e9, "a number > 0, ≤ 2"),
        ("guard.loop_late", 1e9, "a number > 0, ≤ 10"),
        ("guard.hysteresis", -1, "a number ≥ 0"),
        ("guard.period", 1e9, "a number > 0, ≤ 0.1"),
        ("guard.bus_lost", 2.5, "a whole number ≥ 0, ≤ 500"),
        ("guard.slip", 0, "a number > 0"),
        ("guard.slip", float("inf"), "a number > 0"),
        ("record.seconds", -5, "a number ≥ 0.5, ≤ 3600"),
        ("record.seconds", 0, "a number ≥ 0.5, ≤ 3600"),
        ("record.seconds", float("nan"), "a number ≥ 0.5, ≤ 3600"),
        ("record.repeats", 2.7, "a whole number ≥ 0, ≤ 20"),
        ("excite.tries", 0, "a whole number ≥ 1, ≤ 20"),
        ("excite.tries", 1.5, "a whole number ≥ 1, ≤ 20"),
        ("excite.close", -1, "a number > 0, ≤ 1"),
        ("excite.calms", -1, "a whole number ≥ 0, ≤ 100"),
        ("motion.speed", 0, "a number > 0"),
        ("align.seconds", 5, "a number ≥ 10, ≤ 3600"),
        ("home.by_markers", 2, "0 or 1"),
        ("home.by_markers", 0.5, "0 or 1"),
    ],
)
def test_what_is_not_allowed_is_refused_with_what_is(key, value, allowed):
    with pytest.raises(SetupError) as caught:
        overridden(ALL, {key: value})
    assert caught.value.message == f"--set {key}={value:g}: {allowed} is allowed."
    assert caught.value.exit_code == 2


@pytest.mark.parametrize(("table", "name", "value"), SETTABLE)
def test_every_number_has_bounds_that_its_default_keeps(table, name, value):
    schema = number_type(type(getattr(ALL, table)), name).json_schema()
    assert schema["type"] == "boolean" or any(bound in schema for bound in BOUNDS)
    same = getattr(getattr(overridden(ALL, {f"{table}.{name}": float(value)}), table), name)
    assert (same, type(same)) == (value, type(value))


@pytest.mark.parametrize(("name", "place"), GUARDS.items())
def test_a_guard_goes_as_far_as_in_a_rig_file_and_no_farther(name, place):
    guard, threshold = place
    in_rig = type(getattr(GuardsTable(), guard)).model_json_schema()["properties"][threshold]
    by_set = number_type(type(ALL.guard), name).json_schema()
    assert {bound: by_set.get(bound) for bound in BOUNDS} == {bound: in_rig.get(bound) for bound in BOUNDS}


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("align.seconds", 60),
        ("home.by_markers", 1),
        ("excite.close", 0.2),
        ("record.seconds", 20),
        ("record.seconds", 1.5),
        ("motion.settle_over", 0.3),
        ("tension.over", 0.2),
        ("guard.sample_age", 2),
        ("guard.loop_late", 3),
    ],
)
def test_what_docs_and_tests_set_stays_allowed(key, value):
    table, name = key.split(".")
    assert getattr(getattr(overridden(ALL, {key: value}), table), name) == value
