"""Excitation by the winches, moves without swinging, and bringing the platform to rest. Start at `plan.planned`."""
