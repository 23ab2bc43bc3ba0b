"""Free-motion experiments, identification and diagnosis of cable-suspended robots.

    import fidim_lab as fl

    campaign = fl.load("runs/dry-run-1")
    print(fl.identify(campaign))

What stands in `__all__` is the public interface (docs/python.md): the same workflows and defaults as the commands. It
is imported when it is first used, so that `import fidim_lab` costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fidim_lab.api import *

__all__ = [
    "Body",
    "Campaign",
    "Designed",
    "Explained",
    "FidimError",
    "Identified",
    "Robot",
    "Validated",
    "design",
    "explain",
    "identify",
    "load",
    "load_robot",
    "report",
    "simulate",
    "validate",
]


def __getattr__(name: str) -> Any:
    """A public name, imported now."""
    if name in __all__:
        return getattr(import_module("fidim_lab.api"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}; there are {', '.join(__all__)}")


def __dir__() -> list[str]:
    """For completion in notebooks."""
    return sorted({*globals(), *__all__})
