"""Faults that come together, or at odd moments: what the run says beside what the plant did, one row for each."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from benchmarks.rehearsal import rehearsal as rehearsing
from benchmarks.rehearsal import short
from drivers.canbus.transport import CanFrame
from fidim_lab.app import compose
from fidim_lab.data.records import Plan, PlannedWindow, Role
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from procedures.outcomes import Outcome
from procedures.protocols.catalogue import experiment
from sim_backends.bus_faults import FrameRule
from sim_backends.drive.axis.machine import State

RUN_ON = 0.010
"""m of one cable against another within which a guard must have ended it"""
DISOBEYED, BY_WATCHDOG = 0.015, 0.050
"""m at 0.05 m/s: until a quick stop is seen to be ignored and a halt is sent; until the drive misses its host"""
DEAF = "cut the power by hand"
FLICKERS = bytes((0, 0, 0x07))
"""of the first TPDO: the lowest bits of the position"""


def deaf(stage, cable):
    stage.bus.rules.append(FrameRule(frozenset({0x200 + cable, 0x600 + cable}), drop=True))


def frozen(stage, *ids, flickers=b""):
    """Frames with these identifiers have for ever the contents of the first; every other one with its bits changed."""
    for one in ids:
        first: list[bytes] = []

        def repeat(data, first=first):
            first.append(data)
            changed = flickers if len(first) % 2 else b""
            return bytes(byte ^ by for byte, by in zip(first[0], changed.ljust(len(data), b"\0"), strict=True))

        stage.bus.rules.append(FrameRule(frozenset({one}), change=repeat))


def turns_unwanted(stage):
    """A drum, by no set-point of its drive."""
    stage.drive(2).defects.demand_frozen = True
    stage.spin(2, 0.05, unseen=True)


def aborts(stage, cable):
    """Every SDO: not in this state of the drive."""
    stage.bus.rules.append(
        FrameRule(frozenset({0x580 + cable}), change=lambda data: b"\x80" + data[1:4] + bytes.fromhex("22000008"))
    )


def power_gone(stage):
    """The hardware's emergency stop, and a brake of which nothing is left."""
    stage.drive(2).defects.brake_open = True
    for drive in stage.rig.drives:
        drive.od.write(0x605E, 0, b"\x00\x00")
        drive.faults.raise_fault(0x5441, lasting=True)


def comes_back(stage):
    """Firmware that enables its drive by itself after a power cut, at its last speed."""

    async def restart():
        stage.bus.inject(0, bytes((0x81, 2)))
        await stage.sleep(0.3)
        stage.write_sdo(2, 0x60FF, stage.counts(2, 0.05), unseen=True)
        stage.write_byte(2, 0x6060, 3)
        for word in (0x06, 0x07, 0x0F):
            stage.write_word(2, 0x6040, word)

    stage.spawn(restart())


def pulled(stage):
    async def pull():
        await stage.sleep(0.004)
        stage.bus.cut = True

    stage.control.emergency_stop("F12")
    stage.spawn(pull())


def power_cut(stage):
    """Of all drives, as by a fuse: they begin anew."""
    for drive in stage.rig.drives:
        drive.receive(CanFrame(0, bytes((0x81, 0)), stage.now()))


def mixed_up(stage):
    """Drive 2 answers no question, and drive 3's answers come under its identifier, too."""

    async def copy(data):
        stage.bus.inject(0x582, data)

    stage.bus.rules.append(FrameRule(frozenset({0x582}), drop=True))
    stage.bus.tap(lambda frame: stage.spawn(copy(frame.data)) if frame.id == 0x583 else None)


def refusing(stage):
    def refuse(data):
        return bytes.fromhex("8065600030000906") if data[:4] == bytes.fromhex("60656000") else data

    stage.bus.rules.append(FrameRule(frozenset({0x583}), change=refuse))


def never_enabled(stage):
    rule = FrameRule(frozenset({0x203}), change=lambda data: data[:0] if b"\x0f\x01" in data else data)
    stage.bus.rules.append(rule)


def misses_the_host(stage):
    stage.bus.rules.append(FrameRule(frozenset({0x82}), drop=True))
    stage.drive(2).faults.miss_host()


def zeros(stage):
    seen = stage.rig.rig.markers.latest().positions[0]
    stage.mocap.add("jumps", 1e3, tuple(-one for one in seen))


def flood(stage, frame_id):
    """100 frames in each of 100 cycles."""

    async def send():
        for k in range(100):
            for _ in range(100):
                stage.bus.inject(frame_id, (0x2310 + k).to_bytes(2, "little") + bytes(6))
            await stage.sleep(0.01)

    stage.spawn(send())


def swapped(stage, one, other):
    """Through a gateway: each says what the other has said last."""
    last = {}

    def instead(base, own, its, data):
        last[base, own] = data
        return last.get((base, its), data)

    for base in (0x180, 0x280):
        for own, its in ((one, other), (other, one)):
            stage.bus.rules.append(
                FrameRule(frozenset({base + own}), change=lambda data, k=(base, own, its): instead(*k, data))
            )


def soon(stage, strike):
    """5 ms later, between two samples."""

    async def wait():
        await stage.sleep(0.005)
        strike()

    stage.spawn(wait())


def jumps(stage, metres):
    stage.drive(2).faults.jump_encoder(stage.counts(2, metres))


def stopped_in_vain(stage):
    stage.drive(2).defects.encoder_frozen = stage.drive(2).defects.quick_stop_ignored = True
    stage.control.emergency_stop("F12")


@dataclass(frozen=True)
class Case:
    """One combination."""

    step: str
    after: float
    strike: Callable[[Any], Any]
    says: str
    """part of the reason"""
    held: str
    """part of the last sentence"""
    way: float = RUN_ON
    """m that one cable may have gone more than another"""
    outcome: Outcome = Outcome.ERROR


OLD = "NOT VERIFIED that the robot is held: the encoder of winch"
CASES = {
    "cameras and a drive fall silent": Case(
        "MoveTo",
        0.25,
        lambda s: (s.mocap.add("silences", 1e3), setattr(s.drive(2).faults, "silent", True)),
        "winch 2 has not answered for 0.1",
        DEAF,
    ),
    "a lost host that only one drive misses, unsaid": Case(
        "MoveTo", 0.25, misses_the_host, "winch 2 is in state “quick stop active”", "stand still, held"
    ),
    "a deaf drive, and another that talks nonsense": Case(
        "MoveTo",
        0.35,
        lambda s: (deaf(s, 2), s.bus.inject(0x183, b"\xff" * 7)),
        "winch 2 reports a fault: it sends samples and answers no question",
        "winch 2 did not obey the stop",
    ),
    "an unseen set-point in mid-move": Case(
        "MoveTo", 0.25, lambda s: s.send_to(4, -0.3, unseen=True), "winch 4 is -3.", "stand still, held"
    ),
    "another winch turns while one is tried": Case(
        "TryWinches", 0.6, lambda s: s.spin(3, 0.05, unseen=True), "The motion guard", "stand still, held"
    ),
    "a drum turns as power comes": Case(
        "Enable", 0.12, lambda s: s.spin(2, 0.05, unseen=True), "The motion guard", "stand still, held"
    ),
    "two drums creep against each other": Case(
        "Ask",
        0.3,
        lambda s: (s.spin(1, 0.002, unseen=True), s.spin(3, -0.002, unseen=True)),
        "The motion guard",
        "stand still, held",
    ),
    "a deaf drive whose drum turns": Case(
        "Ask", 0.5, lambda s: (deaf(s, 2), s.spin(2, 0.05, unseen=True)), "The motion guard", "winch 2 did not obey"
    ),
    "a disk full and a drum that turns": Case(
        "Record",
        0.3,
        lambda s: (setattr(s.disk, "refuses", 28), s.spin(2, 0.05, unseen=True)),
        "No space left on device",
        "stand still, held",
    ),
    "samples that are frozen, in a move": Case(
        "MoveTo", 0.05, lambda s: frozen(s, 0x182, 0x282), "winch 2", "winch 2 did not obey"
    ),
    "samples that are frozen while the drum turns": Case(
        "Ask",
        0.5,
        lambda s: (frozen(s, 0x182, 0x282), turns_unwanted(s)),
        "its samples (TPDO) stay where they are, its encoder, asked by SDO, is +",
        "winch 2 did not obey",
        way=0.01,
    ),
    "samples that are frozen while a window is recorded": Case(
        "Record", 0.3, lambda s: frozen(s, 0x182, 0x282), "its samples (TPDO) have been exactly the same for", OLD
    ),
    "samples of all drives that are frozen while somebody is at the platform": Case(
        "Ask", 0.3, lambda s: [frozen(s, 0x180 + k, 0x280 + k) for k in (1, 2, 3, 4)], "they are old", OLD
    ),
    "frozen samples that flicker while the drum turns": Case(
        "Ask",
        0.5,
        lambda s: (frozen(s, 0x282), frozen(s, 0x182, flickers=FLICKERS), turns_unwanted(s)),
        "its samples (TPDO) stay where they are, its encoder, asked by SDO, is +",
        "winch 2 did not obey",
        way=0.01,
    ),
    "frozen samples of a drive that refuses to give its encoder, while the drum turns": Case(
        "Ask",
        0.5,
        lambda s: (frozen(s, 0x182, 0x282), aborts(s, 2), s.spin(2, 0.05, unseen=True)),
        "it refuses to give its encoder by SDO (not in this state of the drive",
        "winch 2 did not obey",
    ),
    "an encoder of the drum that stands while the motor creeps": Case(
        "Ask",
        0.5,
        lambda s: (setattr(s.drive(2).defects, "encoder_frozen", True), s.spin(2, 0.01, unseen=True)),
        "winch 2 moves at +0.010 m/s by its drive's velocity, and its encoder does not follow",
        "stand still, held",
    ),
    "a quick stop that is ignored while the drum turns": Case(
        "Ask",
        0.5,
        lambda s: (setattr(s.drive(2).defects, "quick_stop_ignored", True), s.spin(2, 0.05, unseen=True)),
        "winch 2 is +3.",
        "winch 2 did not obey the stop (is +3.",
        way=DISOBEYED,
    ),
    "a stop in words alone while the drum turns": Case(
        "Ask",
        0.5,
        lambda s: (setattr(s.drive(2).defects, "stops_in_words", True), s.spin(2, 0.05, unseen=True)),
        "winch 2 is +3.",
        "winch 2 did not obey the stop",
        way=BY_WATCHDOG,
    ),
    "all power gone, and a brake that slips": Case(
        "Ask", 0.5, power_gone, "all 4 winches report a fault: emergency 0x5441", "winch 2 did not obey the stop"
    ),
    "a drive restarts and is enabled by itself, turning": Case(
        "Ask",
        0.5,
        comes_back,
        "winch 2 reports a fault: the drive restarted by itself",
        "winch 2 was not seen to stop",
    ),
    "a drive answers for another": Case("Settle", 0.0, mixed_up, "answers no question (SDO)", "stand still", way=0.001),
    "a tension that cannot be": Case(
        "Settle", 0.0, lambda s: s.add_tension(1, -100.0), "a cable cannot push", "stand still, held", way=0.001
    ),
    "the cameras lose the marker and say 0 0 0": Case(
        "MoveTo", 0.25, zeros, "marker, or the origin of motion capture", "stand still, held", outcome=Outcome.FAIL
    ),
    "the marker jumps while winches are tried": Case(
        "TryWinches",
        1.5,
        lambda s: s.mocap.add("jumps", 1e3, (0.0, 0.02, 0.0)),
        "winches and drums do not explain this",
        "stand still, held",
        outcome=Outcome.FAIL,
    ),
    "SDO answers that come late, and a drum that turns": Case(
        "Ask",
        0.3,
        lambda s: (setattr(s.drive(2).faults, "sdo_delay", 0.3), s.spin(2, 0.05, unseen=True)),
        "winch 2 is +3.",
        "stand still, held",
    ),
    "SDO answers that come too late": Case(
        "Ask", 0.3, lambda s: setattr(s.drive(2).faults, "sdo_delay", 0.7), "answers no question (SDO)", "stand still"
    ),
    "the cable is pulled just after the emergency stop": Case(
        "MoveTo", 0.3, pulled, "The emergency stop guard stopped the run: F12", DEAF
    ),
    "all power is cut while somebody is at the platform, and comes back": Case(
        "Ask", 0.3, power_cut, "all 4 winches have not answered", DEAF
    ),
    "a lost heartbeat, and another drum turns": Case(
        "Ask",
        0.5,
        lambda s: (s.bus.rules.append(FrameRule(frozenset({0x702}), drop=True)), s.spin(3, 0.05, unseen=True)),
        "winch 3 is +3.",
        "stand still, held",
    ),
    "emergencies of an unknown node in a flood, and a drum turns": Case(
        "Ask", 0.5, lambda s: (flood(s, 0x85), s.spin(2, 0.05, unseen=True)), "winch 2 is +3.", "stand still, held"
    ),
    "each SYNC comes twice, and a drum creeps": Case(
        "Ask",
        0.5,
        lambda s: (s.bus.rules.append(FrameRule(frozenset({0x80}), copies=2)), s.spin(2, 0.005, unseen=True)),
        "winch 2 is +3.",
        "stand still, held",
    ),
    "the samples of two drives come under each other's identifier": Case(
        "Ask",
        0.5,
        lambda s: swapped(s, 2, 3),
        "mm from its commanded position",
        "the encoders of winch 2 and winch 3 are contradicted by their drives",
        way=0.001,
    ),
    "an encoder that stands and a quick stop that is ignored, as somebody stops a move": Case(
        "MoveTo",
        0.4,
        stopped_in_vain,
        "The emergency stop guard stopped the run: F12",
        "winch 2 did not obey the stop (is still in operation enabled after a quick stop",
        way=0.012,
    ),
    "an encoder that jumps as somebody stops a move": Case(
        "MoveTo",
        0.4,
        lambda s: (s.control.emergency_stop("F12"), soon(s, lambda: jumps(s, 0.02))),
        "The emergency stop guard stopped the run: F12",
        "winch 2 stands still; its encoder jumped by +20.0 mm as it was stopped, so its length is not known any more",
    ),
    "an encoder that slips by a millimetre as somebody stops a move": Case(
        "MoveTo",
        0.4,
        lambda s: (s.control.emergency_stop("F12"), soon(s, lambda: jumps(s, 0.001))),
        "The emergency stop guard stopped the run: F12",
        "All winches stand still, held.",
    ),
    "a value refused in bring-up": Case("", 0.0, refusing, "6065:0 following error window", "never reported"),
    "one drive misses its enabling": Case(
        "", 0.0, never_enabled, "after enable operation expected", "without motor power: winch 3"
    ),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.sampled(3)
def test_what_comes_together_is_stopped_named_and_told_as_it_is(rehearsal, truth, name):
    case = CASES[name]
    rehearsal.at(case.step, lambda stage: (truth.watch(stage), case.strike(stage)), after=case.after)
    ended = rehearsal.run()
    report = ended.report
    assert report.outcome is case.outcome
    assert case.says in report.reason
    assert case.held in report.held_says
    assert report.accepted == ()
    if case.step:
        assert np.ptp(truth.moved) <= case.way
        low, high = rehearsal.robot.limits.tension
        assert low <= np.min(truth.tensions)
        assert np.max(truth.tensions) <= high


def three_cables(rehearsal, monkeypatch):
    """A heavier platform on three cables, and where it stands and goes."""
    robot = rehearsal.robot
    cables = []
    for angle, cable in zip(np.deg2rad([90.0, 210.0, 330.0]), robot.cables, strict=False):
        way = np.array([np.cos(angle), np.sin(angle), 0.0])
        cables.append(replace(cable, d=1.2 * way + (0.0, 0.0, 0.5), a=0.18 * way + (0.0, 0.0, 0.26)))
    rehearsal.robot = replace(robot, cables=tuple(cables), winches=robot.winches[:3], mass=14.0)
    windows = []
    for name, place in {"s": (0.0, 0.0, -0.4), "i01": (0.05, 0.03, -0.33)}.items():
        rest = equilibrium_at(Mechanism(rehearsal.robot), rehearsal.robot.nominal, np.array(place))
        aside = np.array([-0.012, 0.018])
        windows.append(PlannedWindow(name, Role.IDENTIFY, np.asarray(rest.lengths), aside, np.array(place)))
    stands = Plan("three cables", tuple(windows))
    monkeypatch.setattr(rehearsing, "STANDS", stands)
    rehearsal.plan = Plan("one window", stands.windows[1:])
    settings = short()
    limits = compose.length_limits(stands)
    rehearsal.settings = replace(settings, motion=replace(settings.motion, length_limits=limits))


THREE = {
    "a drum turns": (
        "Ask",
        lambda s: s.spin(3, 0.05, unseen=True),
        "winch 3 is +3.",
        "All winches stand still, held.",
    ),
    "one deaf, another at fault": (
        "MoveTo",
        lambda s: (deaf(s, 2), s.drive(3).faults.raise_fault(0x2310)),
        "winch 3 reports a fault: emergency 0x2310",
        "winch 2 did not obey the stop",
    ),
}


@pytest.mark.parametrize("name", THREE)
@pytest.mark.sampled(1)
def test_a_robot_of_three_cables_is_stopped_alike(rehearsal, truth, monkeypatch, name):
    three_cables(rehearsal, monkeypatch)
    step, strike, says, held = THREE[name]
    rehearsal.at(step, lambda stage: (truth.watch(stage), strike(stage)), after=0.2)
    report = rehearsal.run().report
    assert says in report.reason
    assert held in report.held_says
    assert np.ptp(truth.moved) <= RUN_ON


def test_power_that_somebody_else_gives_while_nobody_may_have_it_is_stopped(rehearsal, scene, truth):
    """In homing a person is at the platform, and no winch has power."""

    def strike(stage):
        async def go():
            for word in (0x06, 0x07, 0x0F):
                stage.write_pdo(2, unseen=True, controlword=word, mode=1, target=stage.place(2))
            await stage.sleep(0.3)
            stage.spin(2, 0.05, unseen=True)

        truth.watch(stage)
        stage.spawn(go())

    home = experiment("home", Plan("jig", scene.two.windows[:1]), rehearsal.robot, rehearsal.settings)
    rehearsal.at("AskWithoutPower", strike, after=0.1)
    ended = rehearsal.run(home)
    assert ended.trip is not None
    assert ended.trip.guard == "power"
    assert "winch 2 has power; another program" in ended.report.reason
    assert ended.report.held_says == "All winches stand still, without motor power: winch 1, winch 3, winch 4."
    assert np.abs(truth.moved).max() <= 1e-4
    assert [drive.state for drive in ended.drives].count(State.QUICK_STOP_ACTIVE) == 1


@pytest.mark.parametrize("kind", ["freezes", "occlusions", "silences"])
def test_no_move_begins_with_a_marker_that_was_lost_while_somebody_was_at_the_platform(rehearsal, scene, truth, kind):
    rehearsal.plan = scene.two
    rehearsal.at("Ask", lambda stage: (truth.watch(stage), stage.mocap.add(kind, 1e3)), after=0.1)
    ended = rehearsal.run()
    assert ended.trip is not None
    assert ended.trip.guard == "marker"
    assert "MoveTo" in ended.begun
    assert np.abs(truth.moved).max() <= 1e-4
    assert ended.report.held_says == "All winches stand still, held."


def test_a_move_waits_for_a_marker_that_comes_back(rehearsal, scene, truth):
    """All attempts of the first window are lost for it; it is seen again a second after the next move was to begin."""
    seen = []

    def hides(stage):
        async def hide():
            truth.watch(stage)
            while not seen:
                stage.mocap.add("occlusions", 0.15)
                await stage.sleep(0.1)

        stage.spawn(hide())

    rehearsal.plan = scene.two
    rehearsal.at("Ask", hides, after=0.1)
    rehearsal.at("MoveTo", lambda stage: seen.append(stage.now()), nth=2, after=1.0)
    ended = rehearsal.run()
    assert ended.trip is None
    (moving, *_) = (k for k, now in enumerate(truth.lengths) if np.abs(now - truth.lengths[0]).max() > 1e-4)
    assert seen[0] < ended.planted[0] + 0.005 * moving < seen[0] + 0.5
    assert [row.id for row in ended.report.accepted] == ["i02"]
