"""Somebody else on the bus: a second program, a vendor's tool, a drive of the same id."""

from benchmarks.safety.kinds import ANY, POWERED, RESTING, Draw, Fault, When, kind, mm
from drivers.cia402.dictionary import GENERIC_EDS
from sim_backends.drive.axis import DrumShaft
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import read_eds

START, TAKE = 0x2F, 0x3F
"""controlwords of profile position: at once; bit 4 rises"""


def move(stage, cable: int, metres: float) -> None:
    """As a second master would."""
    target = stage.place(cable) + stage.counts(cable, metres)
    for word in (START, TAKE, START):
        stage.write_pdo(cable, controlword=word, mode=1, target=target)


@kind("strangers", "moves a winch", *POWERED)
def moves_one(draw: Draw) -> Fault:
    cable, by = draw.cable(), draw.size(0.003, 0.3)
    says = f"a second master sends winch {cable} elsewhere by {mm(by)}"
    return Fault(says, lambda stage: move(stage, cable, by), (cable,))


@kind("strangers", "moves all winches", *POWERED)
def moves_all(draw: Draw) -> Fault:
    by = draw.size(0.003, 0.2)
    says = f"a second master sends all winches elsewhere by {mm(by)}"
    return Fault(says, lambda stage: [move(stage, cable, by) for cable in (1, 2, 3, 4)], (1, 2, 3, 4))


@kind("strangers", "creeps a winch", *RESTING)
def creeps(draw: Draw) -> Fault:
    cable, by, every = draw.cable(), draw.size(0.0003, 0.002), draw.number(0.1, 0.6)

    def strike(stage):
        async def creep():
            for _ in range(60):
                move(stage, cable, by)
                await stage.sleep(every)

        stage.spawn(creep())

    return Fault(f"winch {cable} creeps by {mm(by)} every {every:.1f} s", strike, (cable,))


@kind("strangers", "spins a drum", *POWERED)
def spins(draw: Draw) -> Fault:
    """Through the drive's own service port: nothing of it is seen on the bus."""
    cable, speed = draw.cable(), draw.size(0.005, 0.1)

    def strike(stage):
        stage.write_sdo(cable, 0x60FF, stage.counts(cable, speed))
        stage.write_pdo(cable, controlword=0x0F, mode=3)

    return Fault(f"a vendor's tool spins drum {cable} at {mm(speed)}/s", strike, (cable,))


@kind("strangers", "writes to a drive", *ANY)
def writes(draw: Draw) -> Fault:
    cable = draw.cable()
    index, subindex, value, what = draw.pick(
        (0x6081, 0, 100_000, "another profile speed"),
        (0x6083, 0, 10_000, "a low acceleration"),
        (0x6084, 0, 1000, "a long stop ramp"),
        (0x6085, 0, 1000, "a long quick stop ramp"),
        (0x605A, 0, 0, "power off as quick stop"),
        (0x6007, 0, 0, "no reaction to a lost host"),
        (0x1016, 1, 0, "no heartbeat wanted"),
        (0x1017, 0, 0, "no heartbeat sent"),
        (0x6065, 0, 2**31 - 1, "no following error"),
        (0x607A, 0, 0, "another target"),
    )
    says = f"another program writes {index:04X} of drive {cable}: {what}"
    return Fault(says, lambda stage: stage.write_sdo(cable, index, value, subindex), (cable,))


@kind("strangers", "commands a drive's state", *POWERED)
def commands(draw: Draw) -> Fault:
    cable = draw.cable()
    word, what = draw.pick(
        (0x02, "quick stop"), (0x12F, "halt"), (0x06, "shutdown"), (0x00, "disable voltage"), (0x07, "switch off")
    )
    return Fault(
        f"another program tells drive {cable}: {what}",
        lambda stage: stage.write_pdo(cable, controlword=word, mode=1),
        (cable,),
    )


@kind("strangers", "NMT command", *ANY)
def nmt(draw: Draw) -> Fault:
    word, what = draw.pick((0x02, "stop"), (0x80, "pre-operational"), (0x81, "reset"), (0x82, "reset communication"))
    to = draw.pick(0, draw.cable())
    says = f"somebody sends NMT {what} to {f'node {to}' if to else 'all nodes'}"
    return Fault(says, lambda stage: stage.bus.inject(0x000, bytes([word, to])), (to,) if to else ())


@kind("strangers", "foreign SYNC", *ANY)
def foreign_sync(draw: Draw) -> Fault:
    every, times = draw.number(0.002, 0.02), draw.whole(20, 400)

    def strike(stage):
        async def sync():
            for _ in range(times):
                stage.bus.inject(0x80, b"")
                await stage.sleep(every)

        stage.spawn(sync())

    return Fault(f"somebody sends {times} SYNC every {1e3 * every:.1f} ms", strike)


@kind("strangers", "a second host", *ANY)
def second_host(draw: Draw) -> Fault:
    """Its heartbeats have the host's id: drives go on believing in a host."""
    times = draw.whole(5, 60)

    def strike(stage):
        async def beat():
            for _ in range(times):
                stage.bus.inject(0x77F, b"\x05")
                await stage.sleep(0.1)

        stage.spawn(beat())

    return Fault(f"somebody sends {times} heartbeats of the host's node id", strike)


@kind("strangers", "answers of another node", *ANY)
def wrong_answers(draw: Draw) -> Fault:
    silent, other = draw.two()

    def strike(stage):
        async def answer(data: bytes):
            stage.bus.inject(0x580 + silent, data)

        stage.bus.tap(lambda frame: stage.spawn(answer(frame.data)) if frame.id == 0x580 + other else None)

    return Fault(f"SDO answers of node {other} come as node {silent}'s too", strike, (silent,))


@kind("strangers", "doubled node id", When.START, When.MOVE, When.ASK)
def doubled(draw: Draw) -> Fault:
    cable, by = draw.cable(), draw.size(0.001, 0.2)

    def strike(stage):
        od = read_eds(GENERIC_EDS, cable)
        od.fix(0x1018, 4, 4711)
        shaft = DrumShaft()
        shaft.set_load(-1.0)
        place = stage.place(cable) + stage.counts(cable, by)
        stage.bus.attach(SimulatedDrive(cable, od, shaft, position=float(place)))

    return Fault(f"a spare drive of node id {cable} hangs on the bus, {mm(by)} away", strike, (cable,))
