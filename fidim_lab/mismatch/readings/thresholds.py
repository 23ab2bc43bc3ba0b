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


READINGS = ReadingThresholds()
