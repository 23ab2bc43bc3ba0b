"""The control loop: SYNC, heartbeat, monitoring of every node, and actions on a drive without a control loop.

In: a transport and a clock. Out: a master, and of each node what it said last, with its time.
"""

from drivers.cia402.watch.master import CanopenMaster
from drivers.cia402.watch.without_power import acknowledge_fault, read_state, set_brake, take_power

__all__ = ["CanopenMaster", "acknowledge_fault", "read_state", "set_brake", "take_power"]
