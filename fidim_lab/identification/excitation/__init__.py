"""Excitation by the winches, travel without swinging, and bringing the platform to rest. `plan.planned` begins it."""
