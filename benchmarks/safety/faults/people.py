"""People, the host computer and its disk."""

import errno
import signal

from benchmarks.safety.kinds import ANY, Draw, Fault, When, kind
from procedures.control import Verb, Word


@kind("people and host", "signal", *ANY)
def interrupted(draw: Draw) -> Fault:
    number, times = draw.pick(signal.SIGINT, signal.SIGTERM, signal.SIGHUP), draw.pick(1, 1, 3)

    def strike(stage):
        async def send():
            for _ in range(times):
                signal.raise_signal(number)
                await stage.sleep(0.05)

        stage.spawn(send())

    return Fault(f"{number.name}, {times} times", strike)


@kind("people and host", "emergency stop", *ANY)
def emergency_stop(draw: Draw) -> Fault:
    return Fault("somebody presses F12", lambda stage: stage.control.emergency_stop("F12"))


@kind("people and host", "a word", *ANY)
def a_word(draw: Draw) -> Fault:
    verb = draw.pick(Verb.ABORT, Verb.SKIP, Verb.RETRY)
    return Fault(f"somebody says “{verb}”", lambda stage: stage.control.say(Word(verb)))


@kind("people and host", "paused", *ANY)
def paused(draw: Draw) -> Fault:
    seconds = draw.some(0.1, 5.0)

    def strike(stage):
        async def resume():
            stage.control.say(Word(Verb.PAUSE))
            await stage.sleep(seconds)
            while stage.control.say(Word(Verb.RESUME)):  # refused while the pause is being carried out: said again
                await stage.sleep(0.5)

        stage.spawn(resume())

    return Fault(f"somebody pauses the run for {seconds:.1f} s", strike)


@kind("people and host", "suspended computer", *ANY)
def suspended(draw: Draw) -> Fault:
    return Fault(
        "the computer sleeps: all drives miss it", lambda stage: [d.faults.miss_host() for d in stage.rig.drives]
    )


@kind("people and host", "disk refuses", When.ENABLE, When.MOVE, When.ASK, When.RECORD)
def disk(draw: Draw) -> Fault:
    number = draw.pick(errno.ENOSPC, errno.EROFS, errno.EIO)
    says = f"the disk refuses to write ({errno.errorcode[number]})"
    return Fault(says, lambda stage: setattr(stage.disk, "refuses", number))
