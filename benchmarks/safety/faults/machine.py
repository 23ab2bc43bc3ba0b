"""The machine is not what the rig file says: drums, cables, drives in each other's place."""

from dataclasses import replace

from benchmarks.safety.kinds import ANY, RESTING, Draw, Fault, When, kind, mm


def change_drum(stage, cable: int, **changes) -> None:
    """Counts mean something else than the rig file says; the load's sign at the motor stays the drive's matter."""
    laboratory = stage.rig.laboratory
    drums = list(laboratory.drums)
    drums[cable - 1] = replace(drums[cable - 1], **changes)
    laboratory.drums = tuple(drums)


@kind("machine", "gear factor", When.START)
def gear(draw: Draw) -> Fault:
    cable, factor = draw.cable(), draw.pick(2.0, 0.5, draw.number(0.8, 1.25))

    def strike(stage):
        change_drum(stage, cable, metres_per_count=factor * stage.rig.laboratory.drums[cable - 1].metres_per_count)

    return Fault(f"drum {cable} winds {factor:g} times what the rig file says", strike, (cable,))


@kind("machine", "all drums", When.START)
def all_drums(draw: Draw) -> Fault:
    factor = draw.pick(draw.number(0.85, 0.95), draw.number(1.05, 1.15), 2.0)

    def strike(stage):
        for cable in (1, 2, 3, 4):
            change_drum(stage, cable, metres_per_count=factor * stage.rig.laboratory.drums[cable - 1].metres_per_count)

    return Fault(f"all drums wind {factor:g} times what the rig file says", strike, (1, 2, 3, 4))


@kind("machine", "polarity", When.START)
def polarity(draw: Draw) -> Fault:
    cable = draw.cable()

    def strike(stage):
        change_drum(stage, cable, direction=-stage.rig.laboratory.drums[cable - 1].direction)

    return Fault(f"rising counts of drive {cable} do the opposite of what the rig file says", strike, (cable,))


@kind("machine", "exchanged drives", When.START)
def exchanged(draw: Draw) -> Fault:
    first, second = draw.two()

    def strike(stage):
        laboratory = stage.rig.laboratory
        shafts = list(laboratory.shafts)
        shafts[first - 1], shafts[second - 1] = shafts[second - 1], shafts[first - 1]
        laboratory.shafts = tuple(shafts)

    return Fault(f"drives {first} and {second} are in each other's place", strike, (first, second))


@kind("machine", "another make", When.START)
def another_make(draw: Draw) -> Fault:
    cable = draw.cable()
    says = f"drive {cable} is of another make"
    return Fault(says, lambda stage: stage.drive(cable).faults.claim_identity(vendor=0x2FF, product=7), (cable,))


def slip(stage, cable: int, metres: float) -> None:
    change_drum(stage, cable, home_length=stage.rig.laboratory.drums[cable - 1].home_length + metres)


@kind("machine", "zero is wrong", When.START)
def wrong_zero(draw: Draw) -> Fault:
    cable, by = draw.cable(), draw.size(0.002, 0.04)
    return Fault(
        f"cable {cable} is {mm(by)} longer than its encoder says", lambda s: slip(s, cable, by), (cable,), 0.0, abs(by)
    )


@kind("machine", "cable slips", *ANY)
def slips(draw: Draw) -> Fault:
    cable, by, seconds = draw.cable(), draw.size(0.002, 0.04), draw.some(0.02, 1.0)
    steps = max(1, round(seconds / 0.01))

    def strike(stage):
        async def slide():
            for _ in range(steps):
                slip(stage, cable, by / steps)
                await stage.sleep(0.01)

        stage.spawn(slide())

    says = f"cable {cable} slips {mm(by)} on its drum in {seconds:.2f} s, unseen by the encoder"
    return Fault(says, strike, (cable,), 0.0, abs(by))


@kind("machine", "cable creeps", *RESTING)
def creeps(draw: Draw) -> Fault:
    cable, speed = draw.cable(), draw.size(0.0005, 0.01)

    def strike(stage):
        async def creep():
            for _ in range(200):
                slip(stage, cable, 0.02 * speed)
                await stage.sleep(0.02)

        stage.spawn(creep())

    says = f"cable {cable} creeps on its drum at {mm(speed)}/s for 4 s, unseen by the encoder"
    return Fault(says, strike, (cable,), 0.0, 4.0 * abs(speed))
