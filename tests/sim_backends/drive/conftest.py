"""One simulated drive on a bench: bytes in, bytes out, and a clock turned by hand."""

import struct
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from drivers.canbus.transport import CanFrame
from sim_backends.drive.axis import DrumShaft
from sim_backends.drive.node import SimulatedDrive
from sim_backends.drive.objects import read_eds

EDS = Path(__file__).parents[3] / "drivers" / "cia402" / "dictionary" / "eds" / "generic_cia402.eds"
NODE = 3
FORMATS = {"u8": "B", "u16": "H", "u32": "I", "i8": "b", "i16": "h", "i32": "i"}


@dataclass
class Bench:
    """Node 3; `heard` is every frame it sent, as "id: bytes"."""

    drive: SimulatedDrive
    shaft: DrumShaft
    t: float = 0.0
    heard: list[str] = field(default_factory=list)

    def frame(self, frame_id: int, data: bytes | str) -> list[str]:
        data = bytes.fromhex(data) if isinstance(data, str) else data
        return self._note(self.drive.receive(CanFrame(frame_id, data, self.t)))

    def run(self, seconds: float) -> list[str]:
        self.t += seconds
        return self._note(self.drive.advance(self.t))

    def sdo(self, request: str) -> str:
        answers = self.frame(0x600 + NODE, request)
        return answers[0].removeprefix("583: ") if answers else ""

    def write(self, index: int, sub: int, kind: str, value: int) -> int:
        """0, or the abort code."""
        data = struct.pack("<" + FORMATS[kind], value)
        answers = self.drive.receive(
            CanFrame(0x603, struct.pack("<BHB4s", 0x23 | (4 - len(data)) << 2, index, sub, data), self.t)
        )
        self._note(answers)
        answer = next(data for cob_id, data in answers if cob_id == 0x583)
        return 0 if answer[0] == 0x60 else int.from_bytes(answer[4:], "little")

    def read(self, index: int, sub: int, kind: str) -> int:
        answers = self.drive.receive(CanFrame(0x603, struct.pack("<BHB4x", 0x40, index, sub), self.t))
        answer = next(data for cob_id, data in answers if cob_id == 0x583)
        return struct.unpack_from("<" + FORMATS[kind], answer, 4)[0]

    def control(self, *words: int) -> None:
        for word in words:
            if refusal := self.write(0x6040, 0, "u16", word):
                pytest.fail(f"controlword {word:#x} aborted with {refusal:#x}")

    def status(self) -> int:
        return self.read(0x6041, 0, "u16")

    def state(self) -> str:
        word = self.status()
        for name, mask, value in STATUS:
            if word & mask == value:
                return name
        pytest.fail(f"statusword {word:#x} is none of the standard's")

    def enable(self) -> None:
        self.write(0x6060, 0, "i8", 1)
        self.control(0x06, 0x07, 0x0F)

    def profile(self, speed: int, acceleration: int, deceleration: int) -> None:
        for index, value in ((0x6081, speed), (0x6083, acceleration), (0x6084, deceleration)):
            self.write(index, 0, "u32", value)

    def go(self, target: int, word: int = 0x1F) -> None:
        self.write(0x607A, 0, "i32", target)
        self.control(word & ~0x10, word)

    def _note(self, frames) -> list[str]:
        texts = [f"{cob_id:03x}: {data.hex(' ')}" for cob_id, data in frames]
        self.heard += texts
        return texts


STATUS = [
    ("NOT READY", 0x4F, 0x00),
    ("SWITCH ON DISABLED", 0x4F, 0x40),
    ("READY", 0x6F, 0x21),
    ("SWITCHED ON", 0x6F, 0x23),
    ("OPERATION ENABLED", 0x6F, 0x27),
    ("QUICK STOP", 0x6F, 0x07),
    ("FAULT REACTION", 0x4F, 0x0F),
    ("FAULT", 0x4F, 0x08),
]


@pytest.fixture
def cold_bench() -> Bench:
    """Power has just come."""
    shaft = DrumShaft()
    bench = Bench(SimulatedDrive(NODE, read_eds(EDS, NODE), shaft, position=1000.0), shaft)
    bench._note(bench.drive.start(0.0))
    return bench


@pytest.fixture
def bench(cold_bench: Bench) -> Bench:
    """Booted, pre-operational, switch on disabled."""
    cold_bench.run(0.01)
    cold_bench.heard.clear()
    return cold_bench
