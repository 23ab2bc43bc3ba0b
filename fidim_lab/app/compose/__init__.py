"""The composition root: the one place that chooses real or simulated hardware. Everything above gets a `Rig`.

`simulated_rig` is a laboratory inside this process (dry runs, tests); `real_rig` the hardware of a rig file; `run_loop`
runs what uses them, on a clock that jumps or waits. `simulated_devices` serves a rig file's devices to other processes.

Parts are imported when they are first asked for: a robot that waits for `fidim resume` needs no simulator.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fidim_lab.app.compose.embedded import Ports, embedded_devices, hand_settings, patient_settings, rehearsal_file
    from fidim_lab.app.compose.loop import STOP_SIGNALS, run_loop
    from fidim_lab.app.compose.real import RealRig, real_rig, require_what_winches_do, rig_settings
    from fidim_lab.app.compose.simulated import (
        MARKER_RATE,
        SYNC_RATE,
        SimulatedRig,
        World,
        hidden_keys,
        length_limits,
        simulated_campaign,
        simulated_rig,
        simulated_world,
        world_truth,
    )
    from fidim_lab.app.compose.simulators import SimulatedDevices, simulated_devices

__all__ = [
    "MARKER_RATE",
    "STOP_SIGNALS",
    "SYNC_RATE",
    "Ports",
    "RealRig",
    "SimulatedDevices",
    "SimulatedRig",
    "World",
    "embedded_devices",
    "hand_settings",
    "hidden_keys",
    "length_limits",
    "patient_settings",
    "real_rig",
    "rehearsal_file",
    "require_what_winches_do",
    "rig_settings",
    "run_loop",
    "simulated_campaign",
    "simulated_devices",
    "simulated_rig",
    "simulated_world",
    "world_truth",
]

_HOMES = {
    **dict.fromkeys(("hand_settings", "embedded_devices", "patient_settings", "Ports", "rehearsal_file"), "embedded"),
    **dict.fromkeys(("run_loop", "STOP_SIGNALS"), "loop"),
    **dict.fromkeys(("real_rig", "RealRig", "require_what_winches_do", "rig_settings"), "real"),
    **dict.fromkeys(
        (
            "hidden_keys",
            "length_limits",
            "MARKER_RATE",
            "simulated_campaign",
            "simulated_rig",
            "simulated_world",
            "SimulatedRig",
            "SYNC_RATE",
            "World",
            "world_truth",
        ),
        "simulated",
    ),
    **dict.fromkeys(("simulated_devices", "SimulatedDevices"), "simulators"),
}
"""name → module of this package"""


def __getattr__(name: str) -> Any:
    """Import what is asked for. Raises AttributeError."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
