"""Profile position mode on the bench: handshake, halt, limits, following error, a motor too weak."""

import pytest

REACHED, LIMIT, ACKNOWLEDGE, FOLLOWING = 0x400, 0x800, 0x1000, 0x2000


@pytest.fixture
def ready(bench):
    """Enabled at 1000 counts; 1000 counts/s, 10 000 counts/s² both ways."""
    bench.profile(1000, 10_000, 10_000)
    bench.enable()
    return bench


def bits(bench):
    word = bench.status()
    return {n for n, bit in (("reached", REACHED), ("limit", LIMIT), ("ack", ACKNOWLEDGE)) if word & bit}


def position(bench):
    return bench.read(0x6064, 0, "i32")


def test_handshake(ready):
    assert bits(ready) == {"reached"}
    ready.write(0x607A, 0, "i32", 3000)
    ready.run(1.0)
    assert position(ready) == 1000  # a target alone moves nothing
    ready.control(0x1F)
    assert bits(ready) == {"ack"}
    ready.control(0x0F)
    assert bits(ready) == set()
    ready.run(2.0)
    assert bits(ready) == set()
    ready.run(0.2)
    assert (position(ready), bits(ready)) == (3000, {"reached"})


def test_the_edge_counts_not_the_level(ready):
    ready.go(2000)
    ready.run(2.0)
    ready.write(0x607A, 0, "i32", 5000)
    ready.control(0x1F)  # bit 4 is still up
    ready.run(2.0)
    assert position(ready) == 2000


def test_a_second_set_point_waits_for_the_first(ready):
    ready.go(2000)
    ready.go(1500)
    assert bits(ready) == {"ack"}
    ready.control(0x0F)
    assert bits(ready) == {"ack"}  # no room yet
    ready.go(9999)  # so this one is not taken
    ready.control(0x0F)
    ready.run(1.11)
    assert bits(ready) == set()
    ready.run(1.0)
    assert position(ready) == 1500


def test_at_once(ready):
    ready.go(10_000)
    ready.run(1.0)
    ready.go(1000, word=0x3F)
    ready.run(5.0)
    assert (position(ready), bits(ready)) == (1000, {"reached", "ack"})


def test_relative(ready):
    ready.go(-300, word=0x5F)
    ready.run(2.0)
    assert position(ready) == 700


def test_halt_stops_on_the_ramp_and_release_goes_on(ready):
    ready.go(6000)
    ready.run(1.05)
    ready.control(0x11F)
    ready.run(0.05)
    assert not ready.status() & REACHED
    ready.run(0.06)
    assert ready.status() & REACHED  # halted: it stands
    assert position(ready) == 1000 + 1000 + 50
    ready.control(0x1F)
    ready.run(5.0)
    assert position(ready) == 6000


def test_a_set_point_taken_while_halted_begins_on_release(ready):
    ready.control(0x10F)
    ready.write(0x607A, 0, "i32", 2000)
    ready.control(0x11F)
    assert bits(ready) == {"ack", "reached"}
    ready.run(2.0)
    assert position(ready) == 1000
    ready.control(0x0F)
    ready.run(2.0)
    assert position(ready) == 2000


def test_position_limits_shorten_the_way(ready):
    ready.write(0x607D, 1, "i32", 500)
    ready.write(0x607D, 2, "i32", 1500)
    ready.go(5000)
    ready.run(2.0)
    assert (position(ready), bits(ready)) == (1500, {"reached", "limit", "ack"})
    ready.go(-5000)
    ready.run(2.0)
    assert position(ready) == 500
    ready.write(0x607D, 1, "i32", 0)
    ready.write(0x607D, 2, "i32", 0)  # none
    ready.go(-5000)
    ready.run(9.0)
    assert position(ready) == -5000


def test_the_largest_speed_and_acceleration_count(ready):
    ready.write(0x607F, 0, "u32", 100)
    ready.write(0x60C5, 0, "u32", 200)
    ready.go(2000)
    ready.run(0.25)
    assert ready.read(0x606C, 0, "i32") == pytest.approx(50, abs=1)
    ready.run(1.0)
    assert ready.read(0x606C, 0, "i32") == 100


def test_no_set_point_in_another_mode(ready):
    ready.write(0x6060, 0, "i8", 0)
    ready.go(2000)
    ready.run(2.0)
    assert (position(ready), ready.status() & ACKNOWLEDGE) == (1000, 0)


def test_leaving_the_mode_stops(ready):
    ready.go(50_000)
    ready.run(1.0)
    ready.write(0x6060, 0, "i8", 0)
    ready.run(1.0)
    assert ready.read(0x606C, 0, "i32") == 0
    ready.write(0x6060, 0, "i8", 1)
    ready.run(1.0)
    assert ready.read(0x606C, 0, "i32") == 0


def test_power_again_holds_where_it_stands(ready):
    ready.go(50_000)
    ready.run(1.0)
    ready.control(0x00)
    ready.run(1.0)
    where = position(ready)
    ready.control(0x06, 0x07, 0x0F)
    ready.run(1.0)
    assert (position(ready), bits(ready)) == (where, {"reached"})


def test_an_encoder_jump_is_a_following_error(ready):
    ready.write(0x6065, 0, "u32", 200)
    ready.write(0x6066, 0, "u16", 50)
    ready.drive.faults.jump_encoder(150)
    ready.run(1.0)
    assert (position(ready), ready.read(0x60F4, 0, "i32")) == (1150, -150)
    assert ready.state() == "OPERATION ENABLED"
    ready.drive.faults.jump_encoder(100)
    ready.run(0.03)
    assert ready.status() & FOLLOWING
    ready.run(0.03)
    assert "083: 11 86 21 00 00 00 00 00" in ready.heard
    ready.run(0.1)
    assert ready.state() == "FAULT"
    assert ready.shaft.motion(ready.t).position == 1000.0
    ready.control(0x00, 0x80, 0x06, 0x07, 0x0F)
    assert (ready.read(0x60F4, 0, "i32"), ready.state()) == (0, "OPERATION ENABLED")
    ready.go(1250)  # where it is, by its encoder
    ready.run(1.0)
    assert ready.shaft.motion(ready.t).position == 1000.0


def test_a_following_error_window_can_be_off(ready):
    ready.write(0x6065, 0, "u32", 0xFFFFFFFF)
    ready.drive.faults.jump_encoder(1_000_000)
    ready.run(1.0)
    assert ready.state() == "OPERATION ENABLED"


def test_a_motor_too_weak_stands_and_faults_but_lets_down(ready):
    ready.write(0x6073, 0, "u16", 400)  # 2 A
    ready.write(0x6065, 0, "u32", 500)
    ready.write(0x6066, 0, "u16", 20)
    ready.shaft.set_load(-2.5)  # pulls towards fewer counts: paying out is more counts
    assert bits(ready) == {"reached", "limit"}
    ready.go(1200)
    ready.run(1.0)
    assert position(ready) == 1200
    ready.go(0)
    ready.run(0.4)
    assert position(ready) > 1190
    assert ready.read(0x60F4, 0, "i32") == pytest.approx(-350, abs=15)
    ready.run(0.4)
    assert ready.state() == "FAULT"


def test_a_motor_that_recovers_goes_on(ready):
    ready.write(0x6073, 0, "u16", 400)
    ready.go(5000)
    ready.run(0.5)
    ready.shaft.set_load(2.5)
    ready.run(0.5)
    ready.shaft.set_load(1.5)
    ready.run(6.0)
    assert (position(ready), bits(ready)) == (5000, {"reached", "ack"})


def test_counts_are_whole_and_wrap_at_32_bits(ready):
    ready.go(1001)
    ready.run(0.0118)
    assert ready.shaft.motion(ready.t).position % 1.0 != 0.0
    assert isinstance(position(ready), int)
    ready.drive.faults.jump_encoder(0x7FFFFFFF)
    assert position(ready) < 0


def test_current_saturates_and_can_be_offset(ready):
    ready.shaft.set_load(1.0)
    ready.drive.faults.offset_current(0.5)
    assert ready.read(0x6078, 0, "i16") == 300
    assert ready.read(0x6077, 0, "i16") == 300
    ready.shaft.set_load(-1e9)
    assert ready.read(0x6078, 0, "i16") == -32768


@pytest.mark.parametrize("steps", [1, 7, 1000])
def test_the_motion_does_not_depend_on_how_often_one_looks(ready, steps):
    ready.profile(1234, 3456, 2345)
    ready.go(1_000_000)
    for _ in range(steps):
        ready.run(1.3 / steps)
    ramp = 1234 / 3456
    assert ready.shaft.motion(ready.t).position == pytest.approx(1000 + 1234 * (1.3 - ramp / 2), abs=1e-6)
