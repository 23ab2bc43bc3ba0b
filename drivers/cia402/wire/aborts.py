"""SDO abort codes (CiA 301) in words."""

_WORDS = {
    0x05030000: "toggle bit not alternated",
    0x05040000: "SDO protocol timed out in the drive",
    0x05040001: "unknown SDO command",
    0x05040002: "invalid block size",
    0x05040003: "invalid sequence number",
    0x05040004: "checksum error",
    0x05040005: "out of memory",
    0x06010000: "access to this object is not supported",
    0x06010001: "this object can only be written",
    0x06010002: "this object can only be read",
    0x06020000: "the drive has no such object",
    0x06040041: "this object cannot be mapped to a PDO",
    0x06040042: "the mapped objects are longer than a PDO",
    0x06040043: "parameters are incompatible",
    0x06040047: "internal incompatibility of the drive",
    0x06060000: "hardware error on access",
    0x06070010: "wrong length for this object",
    0x06070012: "value too long",
    0x06070013: "value too short",
    0x06090011: "the drive has no such sub-index",
    0x06090030: "value not allowed",
    0x06090031: "value too high",
    0x06090032: "value too low",
    0x06090036: "maximum is less than minimum",
    0x060A0023: "resource not available",
    0x08000000: "general error",
    0x08000020: "cannot be stored",
    0x08000021: "cannot be stored: local control",
    0x08000022: "not in this state of the drive",
    0x08000023: "no object dictionary present",
    0x08000024: "no data available",
}


def abort_words(code: int) -> str:
    """An abort code in words, with its number."""
    return f"{_WORDS.get(code, 'unnamed reason')} (SDO abort 0x{code:08X})"
