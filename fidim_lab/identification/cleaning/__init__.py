"""Cleaning before a fit, the same for `identify` and `explain`."""
