"""What stands between host and drives: queues, gateways that mix things up, floods; and drives whose supply dips."""

from benchmarks.safety.faults.bus import NODES, TPDO
from benchmarks.safety.kinds import ANY, POWERED, Draw, Fault, When, kind
from drivers.canbus.transport import CanFrame
from sim_backends.bus_faults import FrameRule

FROM_HOST = frozenset({0x000, 0x080, 0x77F} | {base + node for base in (0x200, 0x300, 0x600) for node in NODES})
FROM_DRIVES = frozenset(base + node for base in (*TPDO, 0x080, 0x580, 0x700) for node in NODES)


class Queue:
    """A rule of a bus: until a time all frames wait, then they pass at once, in their order."""

    drop, copies, change = False, 1, None

    def __init__(self, now, until: float, ids: frozenset[int]) -> None:
        self._now, self._until, self._ids = now, until, ids

    def applies(self, frame: CanFrame) -> bool:
        return frame.id in self._ids and self._now() < self._until

    @property
    def delay(self) -> float:
        return self._until - self._now()


@kind("bus", "adapter keeps a queue", *POWERED)
def queue(draw: Draw) -> Fault:
    seconds = draw.some(0.02, 1.0)
    ids, which = draw.pick(
        (FROM_HOST, "of the host"), (FROM_DRIVES, "of the drives"), (FROM_HOST | FROM_DRIVES, "of all")
    )

    def strike(stage):
        stage.bus.rules.append(Queue(stage.now, stage.now() + seconds, ids))

    return Fault(f"frames {which} wait for {seconds:.2f} s and pass at once", strike)


@kind("bus", "old frames after a bus-off", *POWERED)
def old_frames(draw: Draw) -> Fault:
    seconds, number = draw.some(0.02, 0.5), draw.whole(5, 200)
    ids = frozenset(i + node for i in draw.pick(TPDO, (0x580,), (*TPDO, 0x580, 0x700)) for node in NODES)

    def strike(stage):
        old: list[CanFrame] = []

        async def fail():
            stage.bus.tap(lambda frame: old.append(frame) if frame.id in ids and len(old) < number else None)
            await stage.sleep(0.5)
            stage.bus.fault = "the controller is bus-off"
            await stage.sleep(seconds)
            stage.bus.fault = None
            for frame in list(old):
                stage.bus.inject(frame.id, frame.data)

        stage.spawn(fail())

    return Fault(f"the controller is bus-off for {seconds:.2f} s, then {number} old frames come again", strike)


@kind("bus", "SYNC comes doubled", *ANY)
def sync_doubled(draw: Draw) -> Fault:
    count = draw.pick(1, 20, None)
    rule = FrameRule(frozenset({0x80}), count=count, copies=2)
    return Fault(f"{count or 'all'} SYNC come twice", lambda stage: stage.bus.rules.append(rule))


@kind("bus", "samples under each other's identifier", *POWERED)
def swapped(draw: Draw) -> Fault:
    one, other = draw.two()
    last: dict[int, bytes] = {}

    def instead(own: int, its: int, data: bytes) -> bytes:
        last[own] = data
        return last.get(its, data)

    rules = [
        FrameRule(frozenset({base + own}), change=lambda data, own=base + own, its=base + its: instead(own, its, data))
        for base in TPDO
        for own, its in ((one, other), (other, one))
    ]
    says = f"the samples of drives {one} and {other} come under each other's identifier"
    return Fault(says, lambda stage: stage.bus.rules.extend(rules), (one, other))


@kind("bus", "emergencies in a flood", When.MOVE, When.ASK, When.RECORD)
def emergencies(draw: Draw) -> Fault:
    node, each = draw.pick(draw.cable(), 5, 100), draw.whole(10, 100)

    def strike(stage):
        async def send():
            for k in range(100):
                for _ in range(each):
                    stage.bus.inject(0x80 + node, (0x2310 + k).to_bytes(2, "little") + bytes(6))
                await stage.sleep(0.01)

        stage.spawn(send())

    return Fault(f"{each} emergencies of node {node} in each of 100 cycles", strike)


@kind("drives", "supply dips", *ANY)
def supply_dips(draw: Draw) -> Fault:
    """It boots again, and an incremental encoder counts from zero."""
    cable, heard, zeroed = draw.cable(), draw.pick(True, False), draw.pick(True, False)

    def strike(stage):
        drive = stage.drive(cable)
        drive.receive(CanFrame(0x000, bytes((0x81, cable)), stage.now()))
        if zeroed:
            drive.faults.jump_encoder(-stage.place(cable))
        if heard:
            stage.bus.inject(0x700 + cable, b"\x00")

    says = f"the supply of drive {cable} dips: it boots{'' if heard else ', unheard'}{', from 0' if zeroed else ''}"
    return Fault(says, strike, (cable,))
