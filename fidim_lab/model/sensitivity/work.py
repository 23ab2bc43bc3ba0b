"""How much was integrated in this process: a measure of work that is the same on every computer."""

from dataclasses import dataclass
from threading import Lock


@dataclass(frozen=True)
class IntegrationWork:
    """So many motions, each of one window, and the nodes that they have together."""

    integrations: int = 0
    nodes: int = 0

    def __add__(self, other: "IntegrationWork") -> "IntegrationWork":
        return IntegrationWork(self.integrations + other.integrations, self.nodes + other.nodes)

    def __sub__(self, other: "IntegrationWork") -> "IntegrationWork":
        return IntegrationWork(self.integrations - other.integrations, self.nodes - other.nodes)


class _Counter:
    """Threads integrate side by side."""

    def __init__(self) -> None:
        self.work, self.lock = IntegrationWork(), Lock()


_COUNTER = _Counter()


def count_work(windows: int, nodes: int) -> None:
    """So many windows are integrated, over so many nodes each."""
    with _COUNTER.lock:
        _COUNTER.work += IntegrationWork(windows, windows * nodes)


def work_done() -> IntegrationWork:
    """All so far."""
    return _COUNTER.work
