"""The bus and the host's adapter."""

from benchmarks.safety.kinds import ANY, POWERED, Draw, Fault, When, kind
from sim_backends.bus_faults import FrameRule

NODES = (1, 2, 3, 4)
TPDO = (0x180, 0x280)


@kind("bus", "cut", *ANY)
def cut(draw: Draw) -> Fault:
    return Fault("the cable to the host is cut", lambda stage: setattr(stage.bus, "cut", True))


@kind("bus", "cut for a while", *ANY)
def cut_for_a_while(draw: Draw) -> Fault:
    seconds = draw.some(0.01, 2.0)
    return Fault(f"the cable to the host is loose for {seconds:.2f} s", _bus_for(seconds, "cut", True, False))


@kind("bus", "adapter fails", *ANY)
def adapter(draw: Draw) -> Fault:
    what = draw.pick("the controller is bus-off", "adapter unplugged")
    return Fault(what, lambda stage: setattr(stage.bus, "fault", what))


@kind("bus", "adapter fails for a while", *ANY)
def adapter_for_a_while(draw: Draw) -> Fault:
    seconds = draw.some(0.01, 1.0)
    what = "the controller is bus-off"
    return Fault(f"{what} for {seconds:.2f} s", _bus_for(seconds, "fault", what, None))


def _bus_for(seconds, attribute, struck, mended):
    """The bus with another attribute for a while."""

    def strike(stage):
        async def mend():
            setattr(stage.bus, attribute, struck)
            await stage.sleep(seconds)
            setattr(stage.bus, attribute, mended)

        stage.spawn(mend())

    return strike


@kind("bus", "frames get lost", *ANY)
def lost(draw: Draw) -> Fault:
    cable, every = draw.cable(), draw.whole(2, 20)
    ids = draw.pick(TPDO, (0x200,), (0x600, 0x580), (0x180,), (0x280,))
    rules = [FrameRule(frozenset(i + cable for i in ids), skip=every * k, count=1, drop=True) for k in range(100)]
    names = " ".join(f"{i + cable:03X}" for i in ids)
    return Fault(f"one in {every} of frames {names} gets lost", lambda s: s.bus.rules.extend(rules), (cable,))


@kind("bus", "samples end", *ANY)
def samples_end(draw: Draw) -> Fault:
    cable, ids = draw.cable(), draw.pick(TPDO, (0x180,), (0x280,))
    rule = FrameRule(frozenset(i + cable for i in ids), drop=True)
    names = " ".join(f"{i + cable:03X}" for i in ids)
    return Fault(f"frames {names} do not come any more", lambda stage: stage.bus.rules.append(rule), (cable,))


@kind("bus", "frames come late", *ANY)
def late(draw: Draw) -> Fault:
    cable, seconds = draw.cable(), draw.some(0.002, 0.4)
    ids = draw.pick(TPDO, (0x200,), (0x700,))
    rule = FrameRule(frozenset(i + cable for i in ids), delay=seconds)
    names = " ".join(f"{i + cable:03X}" for i in ids)
    says = f"frames {names} come {1e3 * seconds:.0f} ms late"
    return Fault(says, lambda stage: stage.bus.rules.append(rule), (cable,), seconds if ids == (0x200,) else 0.0)


@kind("bus", "frames come doubled", *ANY)
def doubled(draw: Draw) -> Fault:
    cable, copies = draw.cable(), draw.whole(2, 5)
    rule = FrameRule(frozenset(i + cable for i in (*TPDO, 0x580, 0x200, 0x700)), copies=copies)
    return Fault(f"frames of and to drive {cable} come {copies} times", lambda s: s.bus.rules.append(rule), (cable,))


@kind("bus", "frames are torn", *ANY)
def torn(draw: Draw) -> Fault:
    cable, left = draw.cable(), draw.whole(0, 6)
    ids = draw.pick(TPDO, (0x580,), (0x700,))
    rule = FrameRule(frozenset(i + cable for i in ids), change=lambda data: data[:left])
    names = " ".join(f"{i + cable:03X}" for i in ids)
    return Fault(f"frames {names} have {left} bytes at most", lambda stage: stage.bus.rules.append(rule), (cable,))


@kind("bus", "a bit flips", *POWERED)
def flips(draw: Draw) -> Fault:
    cable, byte, bit, count = draw.cable(), draw.whole(0, 6), draw.whole(0, 7), draw.whole(1, 20)

    def flip(data: bytes) -> bytes:
        return bytes(b ^ (1 << bit) if k == byte else b for k, b in enumerate(data))

    rule = FrameRule(frozenset({0x180 + cable}), count=count, change=flip)
    says = f"bit {bit} of byte {byte} is wrong in {count} samples of drive {cable}"
    return Fault(says, lambda stage: stage.bus.rules.append(rule), (cable,))


@kind("bus", "SYNC gets lost", *ANY)
def sync_lost(draw: Draw) -> Fault:
    count = draw.pick(1, 5, 15, 40, None)
    rule = FrameRule(frozenset({0x80}), count=count, drop=True)
    return Fault(f"{count or 'all'} SYNC get lost", lambda stage: stage.bus.rules.append(rule))


@kind("bus", "host's heartbeat gets lost", *ANY)
def host_beat(draw: Draw) -> Fault:
    count = draw.pick(2, 4, None)
    rule = FrameRule(frozenset({0x77F}), count=count, drop=True)
    return Fault(f"{count or 'all'} heartbeats of the host get lost", lambda stage: stage.bus.rules.append(rule))


@kind("bus", "babbling node", When.MOVE, When.ASK, When.RECORD)
def babble(draw: Draw) -> Fault:
    number, frame = draw.whole(100, 2000), draw.pick(0x001, 0x185, 0x585, 0x705, 0x7E5)

    def strike(stage):
        for k in range(number):
            stage.bus.inject(frame, k.to_bytes(8, "little"))

    return Fault(f"{number} frames {frame:03X} of an unknown node at once", strike)
