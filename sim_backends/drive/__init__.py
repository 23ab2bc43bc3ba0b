"""Simulated CANopen servo drives: `node.SimulatedDrive`, on a dictionary of `objects`, moving a shaft of `axis`."""
