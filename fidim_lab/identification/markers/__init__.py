"""Faults of single marker tracks, found without any dynamics: steps, outliers, frozen and lost frames, uneven clocks.

In: a window's markers (N, M, 3), m, and their noise. Out: findings, and the rows that they take out.
"""
