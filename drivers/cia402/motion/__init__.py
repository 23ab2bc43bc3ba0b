"""The Winch port on one drive: moves, stops, cyclic positions, slack taken up, and trials of its own stops.

In: a master and a WinchConfig. Out: a Winch (drivers.ports).
"""

from drivers.cia402.motion.cyclic import make_winch
from drivers.cia402.motion.slack import pull_taut
from drivers.cia402.motion.trials import WinchTrials
from drivers.cia402.motion.winch import Cia402Winch

__all__ = ["Cia402Winch", "WinchTrials", "make_winch", "pull_taut"]
