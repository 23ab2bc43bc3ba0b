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
