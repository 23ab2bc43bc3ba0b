"""Errors of lengths and cameras: are they as precise as the robot file states, and the same in every window?

In: a fit and the order in which its windows were recorded. Out: `SessionChanges`, what the readings are off by, with
evidence; and the campaign as the sensors should have read it.
"""
