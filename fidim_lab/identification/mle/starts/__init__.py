"""First guesses: initial states, poses and springs from markers alone, bodies that can move.

In: recordings. Out: a point from which the fit converges.
"""
