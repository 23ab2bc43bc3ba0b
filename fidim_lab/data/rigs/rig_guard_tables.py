"""`[guards]` of a rig file, as pydantic checks it: what each guard does when it trips, and when that is.

A threshold's type says how far it may be set; `procedures.settings` has the same types, so that no other way of setting
a guard is wider.
"""

from typing import Annotated, Literal

from pydantic import Field

from fidim_lab.data.files.toml_file import NotNegative, Positive, Table

SampleAge = Annotated[float, Field(gt=0, le=2)]
"""s"""
Slack = Annotated[float, Field(ge=0, lt=1)]
"""part of the robot's lower tension limit"""
Overload = Annotated[float, Field(ge=1, le=3)]
"""part of the upper one"""
TensionFor = Annotated[float, Field(ge=0, le=5)]
"""s"""
SlackHandled = Annotated[float, Field(gt=0, le=60)]
"""s: whoever carries a platform by hand carries it as far as its cables are slack"""
MarkerFor = Annotated[float, Field(gt=0, le=60)]
"""s"""
MarkerOff = Annotated[float, Field(gt=0, le=0.2)]
"""m from where lengths and statics put the main marker"""
MarkerChange = Annotated[float, Field(gt=0, le=0.1)]
"""m, from one place to the next"""
MarkerPart = Annotated[float, Field(ge=0, le=0.2)]
"""of the longest cable's way, in addition"""
FollowingErrorFor = Annotated[float, Field(ge=0, le=10)]
"""s"""
GeometryAllowed = Annotated[float, Field(gt=0, le=0.03)]
"""m of cable"""
DriveTemperature = Annotated[float, Field(gt=0, le=150)]
"""°C"""
TemperatureAge = Annotated[float, Field(gt=0, le=600)]
"""s"""
BusLost = Annotated[int, Field(ge=0, le=500)]
"""bus cycles in a second"""
LoopLate = Annotated[float, Field(gt=0, le=10)]
"""s"""
MotionAllowed = Annotated[float, Field(gt=0, le=0.02)]
"""m of cable: more reacts too late at any speed"""
MotionLate = Annotated[float, Field(ge=0, le=0.5)]
"""s"""
MotionSpeed = Annotated[float, Field(gt=0, le=0.2)]
"""m/s of cable"""
MotionSpeedFor = Annotated[float, Field(ge=0, le=0.5)]
"""s"""


class DriveGuardTable(Table):
    """`[guards.drive]`."""

    reaction: Literal["hold", "quick-stop"] = "quick-stop"


class StaleGuardTable(Table):
    """`[guards.stale_winch]`."""

    reaction: Literal["hold", "quick-stop"] = "quick-stop"
    age: SampleAge = 0.2


class TensionGuardTable(Table):
    """`[guards.tension]`."""

    reaction: Literal["hold", "quick-stop"] = "quick-stop"
    slack: Slack = 0.1
    overload: Overload = 1.25
    hysteresis: NotNegative = 2.0
    lasting: TensionFor = 0.1
    handled: SlackHandled = 2.0


class MarkerGuardTable(Table):
    """`[guards.marker]`."""

    reaction: Literal["hold", "quick-stop", "reject-window", "warn"] = "hold"
    lasting: MarkerFor = 3.0


class MotionGuardTable(Table):
    """`[guards.motion]`: a winch that is not where it was told to be, or moves without a command; at all times."""

    reaction: Literal["hold", "quick-stop"] = "quick-stop"
    allowed: MotionAllowed = 3e-3
    late: MotionLate = 0.06
    speed: MotionSpeed = 0.03
    lasting: MotionSpeedFor = 0.03


class GeometryGuardTable(Table):
    """`[guards.geometry]`: markers that do not fit the lengths told, while every winch should stand."""

    reaction: Literal["hold", "quick-stop"] = "quick-stop"
    allowed: GeometryAllowed = 3e-3


class SlipGuardTable(Table):
    """`[guards.slip]`: the same while a window is recorded."""

    reaction: Literal["hold", "quick-stop", "reject-window", "warn"] = "hold"
    allowed: Positive = 5e-3


class FollowingErrorGuardTable(Table):
    """`[guards.following_error]`: as a part of the winch's own window, beyond which its drive faults."""

    reaction: Literal["hold", "quick-stop", "reject-window", "warn"] = "hold"
    part: Annotated[float, Field(gt=0, le=1)] = 0.75
    lasting: FollowingErrorFor = 1.0


class TemperatureGuardTable(Table):
    """`[guards.temperature]` of the drives, °C, where they tell it."""

    reaction: Literal["hold", "warn"] = "hold"
    limit: DriveTemperature = 75.0
    hysteresis: NotNegative = 5.0
    age: TemperatureAge = 30.0


class BusErrorsGuardTable(Table):
    """`[guards.bus_errors]`: bus cycles in a second that brought no whole sample of a winch."""

    reaction: Literal["hold", "quick-stop", "reject-window", "warn"] = "warn"
    lost: BusLost = 25


class OtherMasterGuardTable(Table):
    """`[guards.other_master]`: somebody else's SYNC, NMT, LSS, RPDO or SDO requests, or two nodes of one id."""

    reaction: Literal["hold", "quick-stop"] = "quick-stop"


class PlaceTable(Table):
    """`[place]`: how far the main marker may be from where cable lengths and statics put it.

    Looked at before anything moves and after each move. A survey good to 2 mm and a centre of mass good to 10 mm leave
    17 mm in the worst of 40 robots.
    """

    off: MarkerOff = 0.03
    change: MarkerChange = 6e-3
    part: MarkerPart = 0.03


class HostLoopGuardTable(Table):
    """`[guards.host_loop]`: this computer came late."""

    reaction: Literal["hold", "quick-stop", "warn"] = "hold"
    late: LoopLate = 0.25


class DiskGuardTable(Table):
    """`[guards.disk]`: bytes that must be free."""

    reaction: Literal["hold", "warn"] = "hold"
    spare: NotNegative = 200e6


class ClockStepGuardTable(Table):
    """`[guards.clock_step]`: the time of day was set while running."""

    reaction: Literal["hold", "warn"] = "warn"


class ReleaseGuardTable(Table):
    """`[guards.release]`: it let go by itself, or was lost while it held."""

    reaction: Literal["hold", "quick-stop"] = "hold"


class GaugesGuardTable(Table):
    """`[guards.gauges]`: load cells or an inclinometer stopped telling."""

    reaction: Literal["hold", "reject-window", "warn"] = "warn"


class GuardsTable(Table):
    """`[guards]`: what each guard does when it trips, and when that is.

    What protects robot and people (drive, stale winch, tension, motion, geometry) always stops; "warn" is for what only
    spoils a record.
    """

    drive: DriveGuardTable = DriveGuardTable()
    stale_winch: StaleGuardTable = StaleGuardTable()
    tension: TensionGuardTable = TensionGuardTable()
    marker: MarkerGuardTable = MarkerGuardTable()
    motion: MotionGuardTable = MotionGuardTable()
    geometry: GeometryGuardTable = GeometryGuardTable()
    slip: SlipGuardTable = SlipGuardTable()
    following_error: FollowingErrorGuardTable = FollowingErrorGuardTable()
    temperature: TemperatureGuardTable = TemperatureGuardTable()
    bus_errors: BusErrorsGuardTable = BusErrorsGuardTable()
    other_master: OtherMasterGuardTable = OtherMasterGuardTable()
    host_loop: HostLoopGuardTable = HostLoopGuardTable()
    disk: DiskGuardTable = DiskGuardTable()
    clock_step: ClockStepGuardTable = ClockStepGuardTable()
    release: ReleaseGuardTable = ReleaseGuardTable()
    gauges: GaugesGuardTable = GaugesGuardTable()
