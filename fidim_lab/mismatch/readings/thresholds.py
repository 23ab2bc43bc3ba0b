"""Thresholds for errors of readings: unit and reason of each."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ReadingThresholds:
    """One field for each decision."""

    smallest: float = 0.5
    """of an encoder's resolution: the smallest error of readings that is asked for"""
    largest: float = 0.02
    """m: larger errors are mistakes of the robot file or of the recording, which other checks name"""
    sizes: int = 25
    """between them, over which evidence is averaged: steps of a third where they span three decades"""
    settling: int = 3
    """rounds in which χ²/dof and the errors agree to a thousandth"""
    most: int = 3
    """kinds of errors in one campaign"""
    odds: float = 3.0
    """nats: odds of 20, by which a rival must lose to be excluded"""
    fewest: int = 3
    """windows, below which their order says nothing"""


READINGS = ReadingThresholds()
