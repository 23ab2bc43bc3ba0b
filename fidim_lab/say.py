"""Progress in words: work that takes a while says what it does, and whoever started it decides where that goes."""

from collections.abc import Callable

Say = Callable[[str], None]
"""takes a line for people"""
