"""The CiA 301 side of a simulated drive: its object dictionary and what reads it, SDO, PDO, EMCY, NMT.

In: an EDS file, frames. Out: entries with rights and ranges, and frames.
"""

from sim_backends.drive.objects.abort import AbortCode
from sim_backends.drive.objects.eds import read_eds

__all__ = ["AbortCode", "read_eds"]
