"""Lengths and cameras themselves: do they read as precisely as the robot file states, and alike in every window?

In: a fit and the order in which its windows were recorded. Out: `ReadingErrors`, what the readings are off by, with
evidence; and the campaign as the sensors should have read it.
"""
