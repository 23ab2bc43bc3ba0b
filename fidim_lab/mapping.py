"""How independent computations are run: one after the other here, or spread over processes by whoever asks for them."""

from collections.abc import Callable, Iterable
from typing import Any

Map = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]
"""like `map`: the same results in the same order, wherever they are computed"""
