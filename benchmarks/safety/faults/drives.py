"""Drives that fail by themselves."""

from benchmarks.safety.kinds import ANY, NEVER, POWERED, RESTING, Draw, Fault, When, kind, mm
from sim_backends.bus_faults import FrameRule

DEAF = 0.7
"""s: the stop is not obeyed (0.1 to 0.2 s until that is seen), then the host's heartbeat is withheld (0.25 s), ramps"""


@kind("drives", "silent", *ANY)
def silent(draw: Draw) -> Fault:
    cable = draw.cable()
    says = f"drive {cable} falls silent, its servo goes on"
    return Fault(says, lambda stage: setattr(stage.drive(cable).faults, "silent", True), (cable,), NEVER)


@kind("drives", "deaf", *ANY)
def deaf(draw: Draw) -> Fault:
    cable = draw.cable()
    rule = FrameRule(frozenset({0x200 + cable, 0x600 + cable}), drop=True)
    says = f"drive {cable} hears no RPDO and no SDO any more"
    return Fault(says, lambda stage: stage.bus.rules.append(rule), (cable,), DEAF)


@kind("drives", "deaf to process data", *ANY)
def deaf_to_pdo(draw: Draw) -> Fault:
    cable = draw.cable()
    rule = FrameRule(frozenset({0x200 + cable}), drop=True)
    return Fault(f"drive {cable} hears no RPDO any more", lambda stage: stage.bus.rules.append(rule), (cable,), DEAF)


@kind("drives", "no SDO answers", *ANY)
def no_sdo(draw: Draw) -> Fault:
    cable = draw.cable()
    return Fault(
        f"drive {cable} answers no SDO any more",
        lambda stage: setattr(stage.drive(cable).faults, "sdo_silent", True),
        (cable,),
    )


@kind("drives", "late SDO answers", *ANY)
def late_sdo(draw: Draw) -> Fault:
    cable, late = draw.cable(), draw.number(0.05, 0.6)
    return Fault(
        f"drive {cable} answers SDO {late:.2f} s late",
        lambda stage: setattr(stage.drive(cable).faults, "sdo_delay", late),
        (cable,),
    )


@kind("drives", "fault", *ANY)
def fault(draw: Draw) -> Fault:
    cable, lasting = draw.cable(), draw.pick(True, False)
    code = draw.pick(0x2310, 0x3210, 0x4210, 0x5441, 0x7300, 0x8611)
    return Fault(
        f"drive {cable} detects fault {code:04X}{', which stays' if lasting else ''}",
        lambda stage: stage.drive(cable).faults.raise_fault(code, lasting=lasting),
        (cable,),
    )


@kind("drives", "safe torque off", *POWERED)
def torque_off(draw: Draw) -> Fault:
    """Of all drives at once, as by the hardware's emergency stop."""

    def strike(stage):
        for drive in stage.rig.drives:
            drive.od.write(0x605E, 0, b"\x00\x00")  # power goes at once, brakes fall
            drive.faults.raise_fault(0x5441, lasting=True)

    return Fault("the emergency stop takes the power from all drives", strike)


@kind("drives", "missed the host", *ANY)
def missed_host(draw: Draw) -> Fault:
    cable = draw.cable()
    lost = draw.pick(True, False)

    def strike(stage):
        if lost:
            stage.bus.rules.append(FrameRule(frozenset({0x80 + cable}), drop=True))
        stage.drive(cable).faults.miss_host()

    says = f"drive {cable} misses the host's heartbeat and stops{', its emergency message is lost' if lost else ''}"
    return Fault(says, strike, (cable,))


@kind("drives", "restarts by itself", *ANY)
def restarts(draw: Draw) -> Fault:
    cable, unseen = draw.cable(), draw.pick(True, False)

    def strike(stage):
        if unseen:
            stage.bus.rules.append(FrameRule(frozenset({0x700 + cable}), count=1, drop=True))
        stage.bus.inject(0x000, bytes([0x81, cable]))

    return Fault(f"drive {cable} restarts{', its boot-up message is lost' if unseen else ''}", strike, (cable,))


@kind("drives", "encoder jumps", *ANY)
def encoder_jumps(draw: Draw) -> Fault:
    cable, by = draw.cable(), draw.size(0.002, 0.08)
    return Fault(
        f"the encoder of drive {cable} jumps by {mm(by)}",
        lambda stage: stage.drive(cable).faults.jump_encoder(stage.counts(cable, by)),
        (cable,),
    )


@kind("drives", "encoder slips on", *RESTING)
def encoder_slips(draw: Draw) -> Fault:
    cable, by, times = draw.cable(), draw.size(0.0005, 0.003), draw.whole(3, 20)

    def strike(stage):
        async def slip():
            for _ in range(times):
                stage.drive(cable).faults.jump_encoder(stage.counts(cable, by))
                await stage.sleep(0.2)

        stage.spawn(slip())

    return Fault(f"the encoder of drive {cable} slips {times} times by {mm(by)}", strike, (cable,))


@kind("drives", "ammeter off", *ANY)
def ammeter_off(draw: Draw) -> Fault:
    cable, newton = draw.cable(), draw.size(10.0, 300.0)
    says = f"the ammeter of drive {cable} is off by {newton:+.0f} N"
    return Fault(says, lambda stage: stage.add_tension(cable, newton), (cable,))


@kind("drives", "ammeter stuck", *ANY)
def ammeter_stuck(draw: Draw) -> Fault:
    cable, shown = draw.cable(), draw.pick(None, 0)
    says = f"the ammeter of drive {cable} shows {'0' if shown == 0 else 'what it shows'} for ever"
    return Fault(says, lambda stage: stage.drive(cable).faults.stick_current(shown), (cable,))


@kind("drives", "hot", *ANY)
def hot(draw: Draw) -> Fault:
    cable, degrees = draw.cable(), draw.number(60, 110)
    says = f"drive {cable} has {degrees:.0f} °C"
    return Fault(says, lambda stage: stage.drive(cable).od.fix(0x2210, 0, round(10 * degrees)), (cable,))


@kind("drives", "heartbeat lost", *ANY)
def heartbeat_lost(draw: Draw) -> Fault:
    cable = draw.cable()
    rule = FrameRule(frozenset({0x700 + cable}), drop=True)
    return Fault(f"the heartbeats of drive {cable} get lost", lambda stage: stage.bus.rules.append(rule), (cable,))


@kind("drives", "refuses a value", *ANY)
def refuses(draw: Draw) -> Fault:
    cable, index = draw.cable(), draw.pick(0x6081, 0x6083, 0x6084, 0x6060, 0x6085, 0x6065)
    place = index.to_bytes(2, "little")

    def refuse(data: bytes) -> bytes:
        return b"\x80" + data[1:4] + bytes.fromhex("30000906") if data[:3] == b"\x60" + place else data

    rule = FrameRule(frozenset({0x580 + cable}), change=refuse)
    says = f"drive {cable} says that it refuses {index:04X} (it has taken it)"
    return Fault(says, lambda stage: stage.bus.rules.append(rule), (cable,))


@kind("drives", "emergency message", *ANY)
def emergency(draw: Draw) -> Fault:
    """Said, and nothing behind it; or a withdrawal of nothing."""
    cable, code, times = draw.cable(), draw.pick(0x0000, 0x8110, 0x4210, 0xFF01), draw.pick(1, 1, 200)

    def strike(stage):
        for _ in range(times):
            stage.bus.inject(0x80 + cable, code.to_bytes(2, "little") + bytes(6))

    return Fault(f"drive {cable} sends emergency {code:04X}, {times} times", strike, (cable,))


@kind("drives", "strange statusword", *POWERED)
def strange_status(draw: Draw) -> Fault:
    cable, times = draw.cable(), draw.whole(1, 30)

    def strike(stage):
        async def say():
            for _ in range(times):
                stage.bus.inject(0x180 + cable, b"\xff" * 7)
                await stage.sleep(0.01)

        stage.spawn(say())

    return Fault(f"{times} samples of drive {cable} are all ones", strike, (cable,))


@kind("drives", "set-point lost", When.MOVE)
def set_point_lost(draw: Draw) -> Fault:
    cable, skip, count = draw.cable(), draw.whole(0, 3), draw.whole(1, 3)
    rule = FrameRule(frozenset({0x200 + cable}), skip=skip, count=count, drop=True)
    says = f"drive {cable} misses {count} RPDO after {skip}"
    return Fault(says, lambda stage: stage.bus.rules.append(rule), (cable,))


@kind("drives", "not enabled", When.ENABLE)
def not_enabled(draw: Draw) -> Fault:
    cable, word = draw.cable(), draw.pick(b"\x0f\x01", b"\x0f\x00", b"\x07\x00")
    rule = FrameRule(frozenset({0x200 + cable}), change=lambda data: data[:0] if word in data[:6] else data)
    says = f"drive {cable} never hears controlword {word[::-1].hex()}"
    return Fault(says, lambda stage: stage.bus.rules.append(rule), (cable,))


@kind("drives", "stops badly", *ANY)
def stops_badly(draw: Draw) -> Fault:
    """A defect that commissioning would have found, and that came since."""
    cable = draw.cable()
    defect = draw.pick(
        *("quick_stop_ignored", "stops_in_words", "ramp_ten_times_too_long", "halt_coasts", "enables_itself"),
        *("heartbeat_ignored", "following_error_ignored", "limit_ignored", "brake_open", "encoder_frozen"),
    )
    says = f"drive {cable} has the defect: {defect.replace('_', ' ')}"
    return Fault(says, lambda stage: setattr(stage.drive(cable).defects, defect, True), (cable,), DEAF)


@kind("drives", "samples frozen", *ANY)
def samples_frozen(draw: Draw) -> Fault:
    """The firmware that fills its PDOs hangs; heartbeat, SDO and the servo live."""
    cable, ids = draw.cable(), draw.pick((0x180, 0x280), (0x180,), (0x280,))
    last: dict[int, bytes] = {}
    rules = [FrameRule(frozenset({i + cable}), change=lambda data, i=i: last.setdefault(i, data)) for i in ids]
    names = " ".join(f"{i + cable:03X}" for i in ids)
    says = f"frames {names} have the same contents for ever"
    return Fault(says, lambda stage: stage.bus.rules.extend(rules), (cable,))


@kind("drives", "old samples", *ANY)
def old_samples(draw: Draw) -> Fault:
    """Through a gateway that keeps a queue."""
    seconds, cables = draw.some(0.3, 3.0), draw.pick((draw.cable(),), (1, 2, 3, 4))
    ids = draw.pick((0x180, 0x280), (0x180, 0x280, 0x580), (0x180, 0x280, 0x580, 0x700))
    rule = FrameRule(frozenset(i + cable for i in ids for cable in cables), delay=seconds)
    names = " ".join(f"{i:03X}" for i in ids)
    says = f"what drives {cables} say ({names}) comes {seconds:.2f} s late"
    return Fault(says, lambda stage: stage.bus.rules.append(rule), cables)


@kind("drives", "aborts every SDO", *ANY)
def aborts(draw: Draw) -> Fault:
    cable = draw.cable()
    code = draw.pick(0x08000022, 0x08000020, 0x06010000).to_bytes(4, "little")
    rule = FrameRule(frozenset({0x580 + cable}), change=lambda data: b"\x80" + data[1:4] + code)
    return Fault(f"drive {cable} aborts every SDO", lambda stage: stage.bus.rules.append(rule), (cable,))


@kind("drives", "SDO tells an old place", *ANY)
def old_place(draw: Draw) -> Fault:
    cable = draw.cable()
    last: list[bytes] = []

    def old(data: bytes) -> bytes:
        if data[1:4] != b"\x64\x60\x00":
            return data
        last.append(data)
        return last[0]

    rule = FrameRule(frozenset({0x580 + cable}), change=old)
    says = f"by SDO drive {cable} tells the place of now for ever"
    return Fault(says, lambda stage: stage.bus.rules.append(rule), (cable,))


@kind("drives", "statusword stuck", *POWERED)
def status_stuck(draw: Draw) -> Fault:
    cable = draw.cable()
    last: list[bytes] = []

    def stuck(data: bytes) -> bytes:
        last.append(data[:2])
        return last[0] + data[2:]

    rule = FrameRule(frozenset({0x180 + cable}), change=stuck)
    says = f"the statusword of drive {cable} stays as it is"
    return Fault(says, lambda stage: stage.bus.rules.append(rule), (cable,))


@kind("drives", "heartbeat of another state", *ANY)
def another_state(draw: Draw) -> Fault:
    cable, state = draw.cable(), draw.pick(0x7F, 0x04, 0x00)
    rule = FrameRule(frozenset({0x700 + cable}), change=lambda _data: bytes((state,)))
    says = f"the heartbeats of drive {cable} say {state:02X}"
    return Fault(says, lambda stage: stage.bus.rules.append(rule), (cable,))


@kind("drives", "restarts enabled", *POWERED)
def restarts_enabled(draw: Draw) -> Fault:
    """Firmware that enables its drive by itself after a power cut, where it stands or at its last speed."""
    cable, later, turning = draw.cable(), draw.some(0.05, 2.0), draw.pick(True, False)
    speed = draw.size(0.005, 0.05)

    def strike(stage):
        async def restart():
            stage.bus.inject(0x000, bytes((0x81, cable)))
            await stage.sleep(later)
            if turning:
                stage.write_sdo(cable, 0x60FF, stage.counts(cable, speed), unseen=True)
                stage.write_byte(cable, 0x6060, 3)
            for word in (0x06, 0x07, 0x0F):
                stage.write_word(cable, 0x6040, word)

        stage.spawn(restart())

    how = f"turning at {mm(speed)}/s" if turning else "where it stands"
    return Fault(f"drive {cable} restarts and is enabled {later:.2f} s later, {how}", strike, (cable,))
