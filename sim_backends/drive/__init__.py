"""Simulated CANopen servo drives: `node.SimulatedDrive`, on a dictionary from `eds.read_eds`, moving a `shaft`."""
