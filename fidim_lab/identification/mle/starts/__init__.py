"""First guesses: initial states, poses and springs from markers alone, possible bodies.

In: recordings. Out: a point from which the fit converges.
"""
