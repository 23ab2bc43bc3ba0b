"""One thread at a time makes and drops CasADi's expressions, and the functions and solvers that are made of them.

CasADi lets go of Python's lock in each of its calls, and keeps each constant of all expressions once, in a table of the
whole process. Who drops the last use of a constant deletes it, even where another thread has just found it in the table
and is about to use it: the heap is corrupted (docs/decisions/threads.md). So `MAKING` is held wherever expressions or
functions are made, and what another thread drops meanwhile is deleted by the one that makes. Numbers need neither:
functions are evaluated in any thread (`batch`).
"""

from collections.abc import Callable, MutableMapping
from threading import RLock
from typing import TypeVar

import casadi as ca

K = TypeVar("K")
V = TypeVar("V")

MAKING = RLock()
"""held while anything of CasADi is made but numbers; not while waiting for another thread that makes something"""

_DROPPED: list[object] = []


def made_once(kept: MutableMapping[K, V], key: K, make: Callable[[], V]) -> V:
    """What is kept there, made if it is not yet; threads that need the same wait for the first."""
    try:
        return kept[key]
    except KeyError:
        pass
    with MAKING:
        if key not in kept:
            kept[key] = make()
        return kept[key]


def _drop(dropped: object, earlier: list[object] = _DROPPED, making: RLock = MAKING) -> None:
    """`__del__` of CasADi's classes, which Python calls once for each object: deletes those that were dropped before.

    This one is deleted with the next, for it outlives this call. While another thread makes, that one deletes all of
    them, with what it drops itself. List and lock are defaults, for at the end of the interpreter modules are empty.
    """
    if making.acquire(blocking=False):
        try:
            earlier.clear()
        finally:
            making.release()
    earlier.append(dropped)


for _kind in (ca.SX, ca.MX, ca.Function):
    _kind.__del__ = _drop  # pyright: ignore[reportAttributeAccessIssue]: not in its stubs
