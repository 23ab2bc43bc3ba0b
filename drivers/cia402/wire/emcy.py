"""Emergency messages (EMCY, CiA 301): bytes to an immutable value, and the code in words. Pure."""

from dataclasses import dataclass

# The longest matching prefix (in hex digits) names the code; the profile leaves the rest to the vendor.
_WORDS = {
    "0000": "no error",
    "10": "generic error",
    "2": "current",
    "21": "current on the input side",
    "22": "current inside the drive",
    "23": "current on the output side",
    "231": "continuous over-current",
    "232": "short circuit or earth leakage",
    "3": "voltage",
    "31": "mains voltage",
    "32": "DC link voltage",
    "321": "DC link over-voltage",
    "322": "DC link under-voltage",
    "33": "output voltage",
    "4": "temperature",
    "41": "ambient temperature",
    "42": "temperature of the drive",
    "43": "temperature of the motor",
    "5": "hardware of the drive",
    "54": "power stage",
    "55": "memory of the drive",
    "6": "software of the drive",
    "61": "internal software",
    "62": "user software",
    "63": "data set",
    "632": "parameter error",
    "7": "additional module",
    "71": "power module or brake chopper",
    "711": "brake",
    "712": "motor blocked",
    "73": "sensor",
    "7305": "encoder",
    "7306": "encoder 2",
    "75": "communication module",
    "8": "monitoring",
    "81": "communication",
    "8110": "CAN overrun, messages lost",
    "8120": "CAN error passive",
    "8130": "heartbeat or node guarding lost",
    "8140": "recovered from bus-off",
    "82": "protocol",
    "8210": "PDO too short, not processed",
    "8220": "PDO too long",
    "83": "torque control",
    "84": "velocity control",
    "85": "position control",
    "86": "positioning",
    "8611": "following error",
    "8612": "reference limit",
    "F": "vendor-specific",
    "FF": "vendor-specific",
}


def emergency_words(code: int) -> str:
    """An emergency code in words, by the most specific entry of the profile's table."""
    digits = f"{code:04X}"
    for length in range(4, 0, -1):
        if digits[:length] in _WORDS:
            return _WORDS[digits[:length]]
    return "unnamed error"


COMMUNICATION = 1 << 4
"""of the error register (1001)"""
GENERIC = 1
_REGISTER = ("generic", "current", "voltage", "temperature", "communication", "profile", "bit 6", "vendor")


def register_words(register: int) -> str:
    """The error register (1001) in words: number and kinds of error. Bit 0 says only that there is one."""
    kinds = [word for bit, word in enumerate(_REGISTER) if register >> bit & 1]
    return f"0x{register:02X} ({', '.join(kinds[1:] if len(kinds) > 1 and register & GENERIC else kinds)})"


@dataclass(frozen=True)
class Emergency:
    """One emergency message."""

    t: float
    """monotonic s of arrival"""
    code: int
    register: int
    """object 1001"""
    vendor: bytes

    @property
    def cleared(self) -> bool:
        """Whether this message says that the error is gone."""
        return self.code == 0

    def __str__(self) -> str:
        text = f"emergency 0x{self.code:04X} ({emergency_words(self.code)})"
        return f"{text}, vendor bytes {self.vendor.hex(' ')}" if any(self.vendor) else text


def decode_emergency(data: bytes, t: float) -> Emergency | None:
    """An EMCY frame; None where it is too short to carry a code (some drives leave out the vendor bytes)."""
    if len(data) < 2 or len(data) > 8:
        return None
    return Emergency(
        t=t, code=int.from_bytes(data[:2], "little"), register=data[2] if len(data) > 2 else 0, vendor=bytes(data[3:])
    )
