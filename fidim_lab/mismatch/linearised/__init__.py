"""Hypotheses, and the first-order response of simulated markers to their parameters.

In: a robot (`hypotheses`), a fit and its trajectories (`columns`). Out: columns of sensitivities, in noise units.
"""
