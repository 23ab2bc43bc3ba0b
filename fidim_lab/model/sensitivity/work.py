"""How many nodes were integrated in this process: a measure of work that is the same on every computer."""

from threading import Lock


class _Counter:
    """Threads integrate side by side."""

    def __init__(self) -> None:
        self.nodes, self.lock = 0, Lock()


_COUNTER = _Counter()


def count_nodes(nodes: int) -> None:
    """So many nodes are integrated."""
    with _COUNTER.lock:
        _COUNTER.nodes += nodes


def nodes_integrated() -> int:
    """Of all motions so far: windows times time steps."""
    return _COUNTER.nodes
