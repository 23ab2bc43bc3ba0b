"""What the robot file predicts for a move and for rest: limits, places, tensions.

In: a robot, settings, cable lengths (m). Out: violations, markers at rest (m), tensions (N) with their bands.
"""

from procedures.expected.nominal_rest import NominalRest
from procedures.expected.place_check import PlaceHistory, SeenAtRest, place_measurements

__all__ = ["NominalRest", "PlaceHistory", "SeenAtRest", "place_measurements"]
