"""Faults of a whole campaign that need no dynamics: noise, encoders, redundancy of sensors, mistakes of the robot file.

In: a campaign. Out: findings, and the windows without the samples that they take out (`screening`).
"""
