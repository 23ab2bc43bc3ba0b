"""The Python interface: what the commands do, as functions that return values (docs/python.md).

Each function runs the workflow of the command of its name, with the same defaults, and gives the same numbers to the
bit. What it returns prints as the command prints, and becomes a pandas table by `to_frame()`, a matplotlib figure by
`plot()`.
"""

from fidim_lab.api.answers import Designed, Explained, Identified, Validated
from fidim_lab.api.calls import Campaign, Robot, design, explain, identify, load, load_robot, report, simulate, validate
from fidim_lab.data.records import Body
from fidim_lab.errors import FidimError

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
