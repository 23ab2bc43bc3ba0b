"""Hypotheses, and how simulated markers answer to their parameters, to first order.

In: a robot (`hypotheses`), a fit and its trajectories (`columns`). Out: columns of sensitivities, in noise units.
"""
