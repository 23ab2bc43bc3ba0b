"""The catalogue of faults, by area. Importing it registers all kinds (`kinds.KINDS`)."""

from benchmarks.safety.faults import bus, drives, gateways, machine, markers, people, strangers

__all__ = ["bus", "drives", "gateways", "machine", "markers", "people", "strangers"]
