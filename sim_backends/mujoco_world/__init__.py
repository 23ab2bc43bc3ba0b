"""The simulated robot in MuJoCo: the same campaigns from another engine and another formulation (an extra install)."""
