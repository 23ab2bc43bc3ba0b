"""The CiA 402 profile as data, without I/O and time: the drive machine, control- and statuswords, counts and metres.

In: words and counts off the bus. Out: states, bits, cable lengths (m).
"""

from drivers.cia402.profile.words import Mode

__all__ = ["Mode"]
