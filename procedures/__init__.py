"""Experiments as generators of frozen steps, and the engine that walks them."""
