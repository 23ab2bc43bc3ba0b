"""CANopen (CiA 301) on the wire: SDO, PDO, EMCY, NMT, SYNC times, and who else commands the drives.

In: frames. Out: values with their times, and the frames that answer.
"""

from drivers.cia402.wire.strangers import Strangers

__all__ = ["Strangers"]
