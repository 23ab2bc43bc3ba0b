"""Motion capture."""

from benchmarks.safety.kinds import ANY, Draw, Fault, When, kind

FOR_EVER = 1e3
SEEN = (When.START, *ANY)


def lasting(draw: Draw) -> float:
    return draw.pick(FOR_EVER, draw.some(0.02, 5.0))


def over(seconds: float) -> str:
    return "from then on" if seconds == FOR_EVER else f"for {seconds:.2f} s"


@kind("motion capture", "marker jumps", *SEEN)
def jumps(draw: Draw) -> Fault:
    seconds, (x, y, z) = lasting(draw), draw.offset(0.003, 1.5)
    says = f"the marker is seen ({1e3 * x:.0f}, {1e3 * y:.0f}, {1e3 * z:.0f}) mm off {over(seconds)}"
    return Fault(says, lambda stage: stage.mocap.add("jumps", seconds, (x, y, z)))


@kind("motion capture", "marker drifts", *ANY)
def drifts(draw: Draw) -> Fault:
    seconds, (x, y, z) = 0.1 * draw.whole(10, 60), draw.offset(0.01, 0.3)
    steps = round(seconds / 0.1)

    def strike(stage):
        async def drift():
            for _ in range(steps):
                stage.mocap.add("jumps", FOR_EVER, (x / steps, y / steps, z / steps))
                await stage.sleep(0.1)

        stage.spawn(drift())

    return Fault(f"the marker drifts by ({1e3 * x:.0f}, {1e3 * y:.0f}, {1e3 * z:.0f}) mm in {seconds:.1f} s", strike)


@kind("motion capture", "zeros", *ANY)
def zeros(draw: Draw) -> Fault:
    seconds = lasting(draw)

    def strike(stage):
        frame = stage.rig.rig.markers.latest()
        if frame is not None and frame.positions[0] is not None:
            x, y, z = frame.positions[0]
            stage.mocap.add("jumps", seconds, (-x, -y, -z))

    return Fault(f"the marker is told to be at the origin {over(seconds)}", strike)


@kind("motion capture", "silence", *SEEN)
def silence(draw: Draw) -> Fault:
    seconds = lasting(draw)
    return Fault(f"no frames come {over(seconds)}", lambda stage: stage.mocap.add("silences", seconds))


@kind("motion capture", "frozen", *SEEN)
def frozen(draw: Draw) -> Fault:
    seconds = lasting(draw)
    return Fault(f"the marker is frozen in its place {over(seconds)}", lambda s: s.mocap.add("freezes", seconds))


@kind("motion capture", "hidden", *SEEN)
def hidden(draw: Draw) -> Fault:
    seconds = lasting(draw)
    return Fault(f"the marker is hidden {over(seconds)}", lambda stage: stage.mocap.add("occlusions", seconds))


@kind("motion capture", "flickers", *ANY)
def flickers(draw: Draw) -> Fault:
    every, times = draw.number(0.04, 0.3), draw.whole(5, 60)

    def strike(stage):
        async def blink():
            for _ in range(times):
                stage.mocap.add("occlusions", every / 2.0)
                await stage.sleep(every)

        stage.spawn(blink())

    return Fault(f"the marker is hidden {times} times, every {every:.2f} s", strike)


@kind("motion capture", "an earlier session", *SEEN)
def strays(draw: Draw) -> Fault:
    seconds = lasting(draw)
    return Fault(f"frames of an earlier session come as well {over(seconds)}", lambda s: s.mocap.add("strays", seconds))


@kind("motion capture", "old places under new numbers", *ANY)
def old_places(draw: Draw) -> Fault:
    seconds, behind = lasting(draw), draw.whole(5, 300)
    says = f"each place is that of {behind} frames before, under its new number, {over(seconds)}"
    return Fault(says, lambda stage: stage.mocap.add("replays", seconds, behind, True))
