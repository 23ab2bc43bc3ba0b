"""Simulated hardware that feeds the real drivers with real bytes."""
