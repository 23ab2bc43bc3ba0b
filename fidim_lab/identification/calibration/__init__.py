"""Calibration of a set-up before bodies are identified: frames, clocks, motor currents, stretch of cables.

In: recordings of a robot at rest or in motion. Out: registrations, calibrations and their uncertainty.
"""
