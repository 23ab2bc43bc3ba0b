"""Profile velocity, homing and cyclic synchronous position of the simulated drive, frame by frame."""

import pytest

LIMITS = ((1, -50_000), (2, 50_000))


def select(bench, mode):
    assert bench.write(0x6060, 0, "i8", mode) == 0
    assert bench.read(0x6061, 0, "i8") == mode


@pytest.fixture
def limited(bench):
    for sub, value in LIMITS:
        bench.write(0x607D, sub, "i32", value)
    bench.profile(speed=10_000, acceleration=20_000, deceleration=20_000)
    return bench


def test_velocity_ramps_holds_and_halts(limited):
    select(limited, 3)
    limited.control(0x06, 0x07, 0x0F)
    assert limited.write(0x60FF, 0, "i32", 5_000) == 0
    limited.run(0.125)
    assert limited.read(0x606C, 0, "i32") == pytest.approx(2_500, abs=150)
    limited.run(0.5)
    assert limited.read(0x606C, 0, "i32") == 5_000
    assert limited.status() & 0x400
    limited.control(0x10F)
    limited.run(0.5)
    assert limited.read(0x606C, 0, "i32") == 0
    assert limited.status() & 0x1000


@pytest.mark.parametrize(("velocity", "limit"), [(20_000, 50_000), (-20_000, -50_000)])
def test_velocity_stops_at_the_position_limits(limited, velocity, limit):
    select(limited, 3)
    limited.control(0x06, 0x07, 0x0F)
    limited.write(0x60FF, 0, "i32", velocity)
    limited.run(12.0)
    assert limited.read(0x6064, 0, "i32") == limit


@pytest.mark.parametrize("method", [35, 37])
def test_home_here(limited, method):
    limited.write(0x6098, 0, "i8", method)
    limited.write(0x607C, 0, "i32", -777)
    select(limited, 6)
    limited.control(0x06, 0x07, 0x0F)
    assert not limited.status() & 0x1000
    limited.control(0x1F)
    assert limited.status() & 0x3400 == 0x1400
    assert limited.read(0x6064, 0, "i32") == -777
    limited.control(0x0F)
    select(limited, 1)
    limited.go(223)
    limited.run(2.0)
    assert limited.read(0x6064, 0, "i32") == 223


def test_methods_with_switches_are_refused(limited):
    assert limited.write(0x6098, 0, "i8", 17) != 0
    limited.write(0x6098, 0, "i8", 0)
    select(limited, 6)
    limited.control(0x06, 0x07, 0x0F)
    limited.control(0x1F)
    assert limited.status() & 0x3000 == 0x2000


def test_cyclic_targets_are_joined_by_straight_lines(limited):
    limited.write(0x60C2, 1, "u8", 10)
    limited.write(0x607F, 0, "u32", 100_000)
    limited.write(0x607A, 0, "i32", 1_000)
    select(limited, 8)
    limited.control(0x06, 0x07, 0x0F)
    assert limited.status() & 0x1000
    for step in range(1, 6):
        limited.write(0x607A, 0, "i32", 1_000 + 40 * step)
        limited.run(0.005)
        assert limited.read(0x6064, 0, "i32") == pytest.approx(1_000 + 40 * step - 20, abs=1)
        limited.run(0.005)
        assert limited.read(0x6064, 0, "i32") == 1_000 + 40 * step
    limited.run(0.1)
    assert limited.read(0x606C, 0, "i32") == 0


def test_cyclic_keeps_to_limits_and_highest_speed(limited):
    limited.write(0x607F, 0, "u32", 10_000)
    limited.write(0x607A, 0, "i32", 1_000)
    limited.write(0x60C2, 1, "u8", 10)
    select(limited, 8)
    limited.control(0x06, 0x07, 0x0F)
    limited.write(0x607A, 0, "i32", 90_000)
    limited.run(0.1)
    assert limited.read(0x6064, 0, "i32") == 2_000  # the host asks for 90 000 within 10 ms: at 607F it takes longer


def test_enabled_with_an_old_target_it_goes_there_at_once(limited):
    """What a driver must prevent, by putting 607A where the shaft is."""
    limited.write(0x607A, 0, "i32", 0)
    select(limited, 8)
    limited.control(0x06, 0x07, 0x0F)
    limited.run(0.1)
    assert limited.read(0x6064, 0, "i32") != 1_000


def test_a_quick_stop_ends_every_mode(limited):
    limited.write(0x605A, 0, "i16", 6)
    select(limited, 3)
    limited.control(0x06, 0x07, 0x0F)
    limited.write(0x60FF, 0, "i32", 5_000)
    limited.run(1.0)
    limited.control(0x02)
    limited.run(1.0)
    assert limited.state() == "QUICK STOP"
    assert limited.read(0x606C, 0, "i32") == 0
    limited.write(0x60FF, 0, "i32", 5_000)
    limited.run(0.2)
    assert limited.read(0x606C, 0, "i32") == 0
