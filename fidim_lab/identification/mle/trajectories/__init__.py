"""Simulated windows against recorded ones: residuals with exact derivatives, normal equations, the optimum.

In: recordings and a start. Out: the optimum over a growing horizon (`stages`).
"""
