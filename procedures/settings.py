"""What a procedure may be told: speeds, tolerances, limits and times, with defaults for a small laboratory robot.

One frozen value for each concern, so that a handler or a guard receives only what it uses. SI units.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum


@dataclass(frozen=True)
class MotionSettings:
    """Moving from one equilibrium to the next, and coming to rest there."""

    speed: float = 0.1
    """m/s of the cable that has the longest way; the others are slowed so that all arrive together"""
    acceleration: float = 0.2
    """m/s²"""
    position_tolerance: float = 1e-3
    """m, a cable's encoder against the length asked for"""
    straight: float = 0.02
    """m by which a cable may leave the straight line in length space that was checked, while all are moving"""
    together: float = 0.25
    """s within which all winches take their set-points: some ten bus cycles; 6 mm at the usual acceleration"""
    settle_tolerance: float = 2e-3
    """m, peak to peak of each marker coordinate"""
    settle_over: float = 1.0
    """s over which it is taken: longer than the slowest mode's period"""
    settle_timeout: float = 8.0
    """s until somebody is asked to steady the platform"""
    settle_tries: int = 4
    """time-outs in a row after which the equilibrium is given up"""
    length_limits: tuple[tuple[float, float], ...] | None = None
    """m, for each winch, from the rig file; None where it has none"""


@dataclass(frozen=True)
class TensionBand:
    """How well a winch's motor current tells its cable's tension, as `fidim tension-calibrate` finds it."""

    friction: float
    """N; as a whole band where there is no scatter, else the part that changes sign with the last move"""
    load_friction: float = 0.0
    """the part of it that grows with the load"""
    scatter: float | None = None
    """N, half the band that is left when the direction of the last move is known"""


@dataclass(frozen=True)
class TensionSettings:
    """Tensions as motor currents tell them."""

    over: float = 1.0
    """s over which currents are averaged at rest"""
    tolerance: float = 0.1
    """what a motor current is worth as a tension: gear friction, as a part of the limit. The check at rest fails
    beyond the robot's limits widened by this much, and is marginal beyond the limits themselves"""
    bands: tuple[TensionBand, ...] | None = None
    """N, for each winch, where all are calibrated: they count instead of the tolerance"""


@dataclass(frozen=True)
class HandSettings:
    """When the hand is away."""

    over: float = 0.5
    """s for which everything below must hold"""
    moving: float = 3e-3
    """m, peak to peak of the marker's fastest coordinate: a platform that is still being held does not move"""
    tension: tuple[float, float] = (0.25, 1.25)
    """smallest and largest tension, as parts of the robot's lower and upper limit"""
    timeout: float = 10.0
    """s"""


@dataclass(frozen=True)
class ReleaseSettings:
    """A release device that holds the displaced platform and lets it go, where the rig has one."""

    by_hand: bool = True
    """somebody is asked to bring the platform to it; else the device fetches it by itself"""
    still: float = 1e-3
    """m, peak to peak of the marker while it is held, before it is let go"""
    over: float = 0.5
    """s for which it must be so"""
    timeout: float = 15.0
    """s"""


@dataclass(frozen=True)
class HomeSettings:
    """Finding the encoders' zeros."""

    by_markers: bool = False
    """measure the pose by three or more markers; else the plan's window says it"""
    over: float = 2.0
    """s"""
    still: float = 2e-3
    """m, peak to peak of each marker coordinate meanwhile"""
    misfit: float = 2e-3
    """m, root mean square of a marker coordinate against the robot file's markers"""
    encoder_still: float = 5e-4
    """m by which an encoder may move meanwhile"""


@dataclass(frozen=True)
class AlignSettings:
    """How late the markers are against the encoders: the platform goes up and down, and both look."""

    amplitude: float = 0.015
    """m up and down from the window's place"""
    seconds: float = 30.0
    """of looking; ten are the least that correlation takes, and a busy computer scatters what it sees"""
    speed: float = 0.1
    """m/s"""
    acceleration: float = 0.5
    """m/s²"""
    sd: float = 1e-3
    """s that the lag may be uncertain by"""


@dataclass(frozen=True)
class ExciteSettings:
    """Winches that excite, calm and travel (`excite`)."""

    speed: float = 0.5
    """m/s of any cable, at most; never more than the rig file allows"""
    acceleration: float = 1.0
    """m/s², likewise: high damping wants more"""
    offset: float = 0.06
    """m off the equilibrium's lengths"""
    seconds: float = 12.0
    """for the strokes of one excitation"""
    tries: int = 2
    """recordings of a window until its swing is taken as it is"""
    close: float = 0.15
    """part by which the swing may miss the planned one"""
    watch: float = 2.5
    """s of looking before a swing is calmed"""
    patience: float = 1.5
    """s that the platform is given to settle by itself"""
    calms: int = 8
    """times that it is calmed at one equilibrium: where little is known each takes half the swing away"""
    small: float = 3e-3
    """m of swing with which a move may begin"""
    left: float = 1e-3
    """m of swing that a move may leave"""


@dataclass(frozen=True)
class RecordSettings:
    """Recording a window, and what makes it a good one."""

    seconds: float = 10.0
    repeats: int = 3
    """how often a rejected window is recorded again"""
    longest_gap: float = 0.1
    """s without a new marker position"""
    complete: float = 0.98
    """part of the samples that must be there"""
    jump: float = 5e-3
    """m by which a marker may leave the middle of its two neighbours in time, twice over: a swinging platform stays
    under 2 mm at 100 Hz, a damaged packet or a marker that was taken for another does not"""
    amplitude: float = 5e-3
    """m, peak to peak of the marker's largest coordinate: less tells too little"""
    displacement: float = 1.25
    """largest displacement from rest in x, y as a part of the robot's free_displacement limit"""
    motors_still: float = 3e-3
    """m, peak to peak of an encoder length: a drive that gives way under the motion's tension"""
    tension_over: float = 0.05
    """s, moving average over the current sensor's noise"""


class Reaction(StrEnum):
    """What a guard's trip does to all winches at once."""

    HOLD = "hold"
    """stop on the ramp and hold with power on"""
    QUICK_STOP = "quick stop"
    REJECT_WINDOW = "reject window"
    """nothing at once: the window that is being recorded is rejected when it is checked, and recorded again"""
    WARN = "warn"
    """the run goes on, and everybody is told once"""


@dataclass(frozen=True)
class GuardSettings:
    """What stops a run at once. Every guard looks at each cycle."""

    period: float = 0.01
    """s between two looks"""
    sample_age: float = 0.2
    """s after which a winch sample is unknown"""
    slack: float = 0.1
    """lower tension threshold, as a part of the robot's lower limit"""
    overload: float = 1.25
    """upper tension threshold, as a part of the robot's upper limit"""
    hysteresis: float = 2.0
    """N by which a tension must come back before its violation is forgotten"""
    tension_for: float = 0.1
    """s for which a tension must be beyond its threshold"""
    current_stuck: float = 1.0
    """s for which a motor current may stay exactly the same while its winch moves"""
    marker_for: float = 3.0
    """s for which the main marker may be lost or frozen"""
    slip: float = 5e-3
    """m by which an encoder may leave its place while a window is recorded"""
    following_error: float = 0.015
    """m of cable by which a motor may be off the place that its drive wants: under the drive's own window"""
    following_error_for: float = 1.0
    """s: it is asked for twice a second"""
    temperature: float = 75.0
    """°C of a drive: most derate or trip at 80 to 90"""
    temperature_hysteresis: float = 5.0
    """K"""
    temperature_age: float = 30.0
    """s after which a temperature that was told before is missed"""
    bus_lost: int = 25
    """bus cycles in a second that may bring no sample: a tenth at 250 Hz"""
    loop_late: float = 0.25
    """s between two looks: drives that hear no more of their host for so long stop by themselves"""
    disk_spare: float = 200e6
    """bytes that must be free: an hour of everything"""
    reactions: Mapping[str, Reaction] = field(default_factory=dict[str, Reaction])
    """by guard name, where it is not the guard's own"""


@dataclass(frozen=True)
class HoldSettings:
    """How a run ends, whatever ended it."""

    timeout: float = 3.0
    """s for all winches to confirm the hold"""
    still_for: float = 0.2
    """s for which encoders must stand still"""
    still: float = 5e-4
    """m by which an encoder may move meanwhile"""


@dataclass(frozen=True)
class Settings:
    """All of them."""

    motion: MotionSettings = field(default_factory=MotionSettings)
    tension: TensionSettings = field(default_factory=TensionSettings)
    hand: HandSettings = field(default_factory=HandSettings)
    excite: ExciteSettings = field(default_factory=ExciteSettings)
    record: RecordSettings = field(default_factory=RecordSettings)
    guard: GuardSettings = field(default_factory=GuardSettings)
    hold: HoldSettings = field(default_factory=HoldSettings)
    home: HomeSettings = field(default_factory=HomeSettings)
    align: AlignSettings = field(default_factory=AlignSettings)
    release: ReleaseSettings | None = None
    """None: the rig has none, a hand lets go"""
    prompt_estimate: float = 15.0
    """s that a person needs to answer a prompt, for the time estimate only"""
