"""The moving side of a simulated drive: the CiA 402 machine, its modes, the way of the shaft, what is measured of it.

In: controlwords, targets and loads. Out: states, counts, currents; defects that only a trial finds.
"""

from sim_backends.drive.axis.defects import Defects
from sim_backends.drive.axis.make import Ampere, Make
from sim_backends.drive.axis.profile import Profile, ShaftMotion
from sim_backends.drive.axis.shaft import DrumShaft

__all__ = ["Ampere", "Defects", "DrumShaft", "Make", "Profile", "ShaftMotion"]
