"""Ties a drive's object dictionary to its parts: live values, option codes it supports, entries that it keeps."""

from sim_backends.drive.axis.axis import MODES, Axis
from sim_backends.drive.axis.make import PROFILE, Make
from sim_backends.drive.axis.other_modes import HOME_HERE
from sim_backends.drive.objects.abort import AbortCode
from sim_backends.drive.objects.dictionary import Dictionary, Guard
from sim_backends.drive.objects.emergency import ErrorLog

_OPTIONS = {
    0x6007: (0, 1, 2, 3),
    0x605A: (0, 1, 2, 5, 6),
    0x605B: (0, 1),
    0x605C: (0, 1),
    0x605D: (1, 2),
    0x605E: (0, 1, 2),
    0x6086: (0,),
    0x6098: (0, *HOME_HERE),
    0x1029: (0, 1, 2),
}
"""option codes that this drive has; others are refused, as vendors do that support subsets"""


def connect(dictionary: Dictionary, axis: Axis, errors: ErrorLog, make: Make = PROFILE) -> None:
    """Attach sources, guards and watchers; say in 6502 which modes there are, of those that its file names."""
    ours = sum(1 << mode - 1 for mode in MODES)
    dictionary.fix(0x6502, 0, dictionary.number(0x6502) & ours or ours)
    feedback = axis.feedback
    dictionary.attach(0x6041, source=axis.statusword)
    dictionary.attach(0x6061, source=lambda: axis.mode)
    dictionary.attach(0x6062, source=feedback.demand)
    dictionary.attach(0x6064, source=feedback.position)
    dictionary.attach(0x606B, source=feedback.velocity)
    dictionary.attach(0x606C, source=feedback.velocity)
    dictionary.attach(0x6074, source=feedback.current)
    dictionary.attach(0x6077, source=feedback.current)
    dictionary.attach(0x6078, source=feedback.current)
    if (own := make.load) is not None and not isinstance(spec := dictionary.find(own.index, own.sub), AbortCode):
        bits = 8 * (spec.size or 4)
        dictionary.attach(own.index, own.sub, source=lambda: feedback.vendor_current(own.ampere, bits))
    dictionary.attach(0x60F4, source=feedback.lag)
    dictionary.attach(0x6040, watcher=lambda _subindex, word: axis.control(word))
    dictionary.attach(
        0x6060, guard=lambda _subindex, mode: axis.allows_mode(mode), watcher=lambda _subindex, mode: axis.select(mode)
    )
    for target in (0x6071, 0x607A, 0x60FF):
        dictionary.attach(target, watcher=lambda _subindex, _value: axis.new_target())
    dictionary.attach(0x1003, guard=_only_zero, watcher=lambda _subindex, _value: errors.clear_history())
    dictionary.attach(0x1005, guard=lambda _subindex, value: None if value == 0x80 else AbortCode.VALUE)
    dictionary.attach(0x1014, guard=_keeps_id(dictionary, 0x1014))
    for index, allowed in _OPTIONS.items():
        dictionary.attach(index, guard=_one_of(allowed))


def _only_zero(_subindex: int, value: int) -> AbortCode | None:
    return AbortCode.VALUE if value else None


def _one_of(allowed: tuple[int, ...]) -> Guard:
    return lambda _subindex, value: None if value in allowed else AbortCode.VALUE


def _keeps_id(dictionary: Dictionary, index: int) -> Guard:
    """Only bit 31 (off) may change."""
    return lambda _subindex, value: (
        None if value & 0x7FFFFFFF == dictionary.number(index) & 0x7FFFFFFF else AbortCode.VALUE
    )
