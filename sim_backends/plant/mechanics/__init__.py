"""The equations of the simulated robot: kinematics, forces, dynamics and rest as CasADi functions of a World.

In: a World. Out: compiled steps, wrenches, and the pose and tensions of a rest.
"""

from sim_backends.plant.mechanics.loads import loads_in, mass_of
from sim_backends.plant.mechanics.statics import Rest, Statics

__all__ = ["Rest", "Statics", "loads_in", "mass_of"]
