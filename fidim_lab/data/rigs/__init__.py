"""Rig files, and what is kept beside one: encoder zeros, an emergency stop, the delay of motion capture."""
