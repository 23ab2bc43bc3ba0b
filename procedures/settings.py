"""Settings of procedures: speeds, tolerances, limits and times, with defaults for a small laboratory robot.

One frozen value for each concern, so that a handler or a guard receives only what it uses. SI units.

A number's type says what a person may set it to (`fidim run --set`). What guards is bounded as in a rig file, by the
same types. Our own code is not held to them: a rehearsal waits longer than anybody may ask for.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated

from pydantic import Field

from drivers.ports import Prompt, PromptKind
from fidim_lab.data.files.toml_file import NotNegative, Positive
from fidim_lab.data.rigs.rig_guard_tables import (
    BusLost,
    DriveTemperature,
    FollowingErrorFor,
    GeometryAllowed,
    LoopLate,
    MarkerChange,
    MarkerFor,
    MarkerOff,
    MarkerPart,
    MotionAllowed,
    MotionLate,
    MotionSpeed,
    MotionSpeedFor,
    Overload,
    SampleAge,
    Slack,
    SlackHandled,
    TemperatureAge,
    TensionFor,
)

LONGEST_TOGETHER = 0.5
"""s; at the usual acceleration a winch that went alone would be 25 mm ahead by then"""
Seconds = Annotated[float, Field(gt=0, le=60)]
"""of looking, averaging, holding still"""
Timeout = Annotated[float, Field(gt=0, le=600)]
"""s"""
Still = Annotated[float, Field(gt=0, le=0.05)]
"""m that a marker or an encoder may move: more is no stillness"""
EncoderStill = Annotated[float, Field(gt=0, le=0.01)]
"""m of cable, where a motor holds"""


@dataclass(frozen=True)
class MotionSettings:
    """Moving from one equilibrium to the next, and coming to rest there."""

    speed: Positive = 0.1
    """m/s of the cable that has the longest way; the others are slowed so that all arrive together"""
    acceleration: Positive = 0.2
    """m/s²"""
    position_tolerance: EncoderStill = 1e-3
    """m, a cable's encoder against the length asked for"""
    straight: Annotated[float, Field(gt=0, le=0.1)] = 0.02
    """m by which a cable may leave the straight line in length space that was checked, while all are moving"""
    together: Annotated[float, Field(gt=0, le=LONGEST_TOGETHER)] = 0.2
    """s within which all winches take their set-points: twenty bus cycles; the others go 4 mm at the usual acceleration
    until then, and 4 mm more to their stop"""
    settle_tolerance: Still = 2e-3
    """m, peak to peak of each marker coordinate"""
    settle_over: Seconds = 1.0
    """s over which it is taken: longer than the slowest mode's period"""
    settle_timeout: Timeout = 8.0
    """s until somebody is asked to steady the platform"""
    settle_tries: Annotated[int, Field(ge=1, le=100)] = 4
    """time-outs in a row after which the equilibrium is given up"""
    length_limits: tuple[tuple[float, float], ...] | None = None
    """m, for each winch, from the rig file; None where it has none"""
    highest_speed: float | None = None
    """m/s that all winches may do, from the rig file: no step may ask for more"""
    highest_acceleration: float | None = None
    """m/s², likewise"""


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

    over: Seconds = 1.0
    """s over which currents are averaged at rest"""
    tolerance: Annotated[float, Field(ge=0, le=0.5)] = 0.1
    """what a motor current is worth as a tension: gear friction, as a part of the limit. The check at rest fails
    beyond the robot's limits widened by this much, and is marginal beyond the limits themselves"""
    bands: tuple[TensionBand, ...] | None = None
    """N, for each winch, where all are calibrated: they count instead of the tolerance"""


@dataclass(frozen=True)
class PlaceSettings:
    """Lengths and markers held against each other.

    Defaults for robots like IRMA4 (`python -m benchmarks.place_errors`): where anchors and zeros are known to 2 mm and
    the centre of mass to 10 mm, the marker of the worst of 40 robots is 17 mm off; to 20 mm: 31 mm. Over a move that
    changes by 2 % of it at most; the answer to a jog by a quarter to 40 %, that of all winches together by 1 %.
    """

    off: MarkerOff = 0.03
    """m by which the marker may be away from the place that lengths and statics give"""
    change: MarkerChange = 6e-3
    """m by which that may change from one place to the next"""
    part: MarkerPart = 0.03
    """of the longest cable's way, in addition"""
    way: Annotated[float, Field(gt=0, le=0.01)] = 4e-3
    """m of cable by which each winch is tried: under what a journal takes for the same place"""
    speed: Positive = 0.02
    """m/s"""
    acceleration: Positive = 0.1
    """m/s²"""
    over: Seconds = 1.5
    """s of looking at each answer; two periods of the slowest swing where that is longer"""
    response: Annotated[float, Field(gt=0, le=1)] = 0.6
    """part of the model's answer by which a marker's may differ: a reversed winch differs by 2, a doubled one by 1"""
    scale: Annotated[float, Field(gt=0, le=0.5)] = 0.07
    """part by which all winches together may move the marker more or less than the model says"""
    telling: Positive = 1.0
    """N: a change of tension that a motor current shows"""


@dataclass(frozen=True)
class HandSettings:
    """When the hand is away."""

    over: Seconds = 0.5
    """s for which everything below must hold"""
    moving: Still = 3e-3
    """m, peak to peak of the marker's fastest coordinate: a platform that is still being held does not move"""
    tension: tuple[float, float] = (0.25, 1.25)
    """smallest and largest tension, as parts of the robot's lower and upper limit"""
    timeout: Timeout = 10.0
    """s"""


@dataclass(frozen=True)
class ReleaseSettings:
    """A release device that holds the displaced platform and lets it go, where the rig has one."""

    by_hand: bool = True
    """somebody is asked to bring the platform to it; else the device fetches it by itself"""
    still: Still = 1e-3
    """m, peak to peak of the marker while it is held, before it is let go"""
    over: Seconds = 0.5
    """s for which it must be so"""
    timeout: Timeout = 15.0
    """s"""


@dataclass(frozen=True)
class HomeSettings:
    """Finding the encoders' zeros."""

    taut: bool = False
    """take up slack by torque first, and take the counts while the motors pull"""
    by_markers: bool = False
    """measure the pose by three or more markers; else the plan's window says it"""
    over: Seconds = 2.0
    """s"""
    still: Still = 2e-3
    """m, peak to peak of each marker coordinate meanwhile"""
    misfit: Still = 2e-3
    """m, root mean square of a marker coordinate against the robot file's markers"""
    encoder_still: EncoderStill = 5e-4
    """m by which an encoder may move meanwhile"""


@dataclass(frozen=True)
class TautSettings:
    """Taking up slack by torque, one cable after another; the platform stands in a jig or on its stand."""

    tension: NotNegative = 0.0
    """N; 0: the robot's lowest allowed tension"""
    speed: Annotated[float, Field(gt=0, le=0.2)] = 0.05
    """m/s at which a slack cable is wound, as a winch's stops are tried"""
    way: Annotated[float, Field(gt=0, le=2)] = 0.2
    """m that a cable may be wound until it is taut: more slack is somebody's to look at"""


@dataclass(frozen=True)
class CommissionSettings:
    """Proving the stops of each winch by trial, without load."""

    speed: Annotated[float, Field(gt=0, le=0.2)] = 0.05
    """m/s: a stop on a ramp of 2 m/s² takes 25 ms and 0.6 mm from it, one of a tenth of that 0.25 s and 6 mm"""
    acceleration: Positive = 0.2
    """m/s²"""
    watch: Seconds = 1.0
    """s for which a winch must stay where it has stopped, with power and again without"""
    still: EncoderStill = 1e-4
    """m of cable; less is no motion"""
    late: Annotated[float, Field(gt=0, le=0.5)] = 0.06
    """s that a stop may take besides reaction and ramp: bus and drive cycles, and looks at the encoder, as
    `guard.motion_late`; at 0.15 a ramp that is ten times too long (0.25 s instead of 0.025) is seen barely"""


@dataclass(frozen=True)
class AlignSettings:
    """The delay of the markers against the encoders, measured while the platform goes up and down."""

    amplitude: Annotated[float, Field(gt=0, le=0.1)] = 0.015
    """m up and down from the window's place"""
    seconds: Annotated[float, Field(ge=10, le=3600)] = 30.0
    """of looking; ten are the least that correlation takes, and a busy computer scatters what it sees"""
    speed: Positive = 0.1
    """m/s"""
    acceleration: Positive = 0.5
    """m/s²"""
    sd: Annotated[float, Field(gt=0, le=0.1)] = 1e-3
    """s that the lag may be uncertain by"""


@dataclass(frozen=True)
class ExciteSettings:
    """Winches that excite, calm and travel (`excite`)."""

    speed: Positive = 0.5
    """m/s of any cable, at most; never more than the rig file allows"""
    acceleration: Positive = 1.0
    """m/s², likewise: high damping wants more"""
    offset: Annotated[float, Field(gt=0, le=0.5)] = 0.06
    """m off the equilibrium's lengths"""
    seconds: Annotated[float, Field(gt=0, le=120)] = 12.0
    """for the strokes of one excitation"""
    tries: Annotated[int, Field(ge=1, le=20)] = 2
    """recordings of a window until its swing is taken as it is"""
    close: Annotated[float, Field(gt=0, le=1)] = 0.15
    """part by which the swing may miss the planned one"""
    watch: Seconds = 2.5
    """s of looking before a swing is calmed"""
    patience: Annotated[float, Field(ge=0, le=60)] = 1.5
    """s that the platform is given to settle by itself"""
    calms: Annotated[int, Field(ge=0, le=100)] = 8
    """times that it is calmed at one equilibrium: where little is known each takes half the swing away"""
    small: Still = 3e-3
    """m of swing with which a move may begin"""
    left: Still = 1e-3
    """m of swing that a move may leave"""


@dataclass(frozen=True)
class RecordSettings:
    """Recording a window, and what makes it a good one."""

    seconds: Annotated[float, Field(ge=0.5, le=3600)] = 10.0
    repeats: Annotated[int, Field(ge=0, le=20)] = 3
    """how often a rejected window is recorded again"""
    longest_gap: Annotated[float, Field(gt=0, le=10)] = 0.1
    """s without a new marker position"""
    complete: Annotated[float, Field(gt=0, le=1)] = 0.98
    """part of the samples that must be there"""
    jump: Annotated[float, Field(gt=0, le=0.1)] = 5e-3
    """m by which a marker may leave the middle of its two neighbours in time, twice over: a swinging platform stays
    under 2 mm at 100 Hz, a damaged packet or a marker that was taken for another does not"""
    drift: Annotated[float, Field(gt=0, le=1)] = 0.03
    """m of slow motion of the main marker besides its swing, and 0.3 of the swing's amplitude: honest windows have up
    to 0.18 of it (18 windows of three campaigns); beyond a third of it it is told, beyond it rejected"""
    amplitude: Annotated[float, Field(ge=0, le=0.5)] = 5e-3
    """m, peak to peak of the marker's largest coordinate: less tells too little"""
    displacement: Annotated[float, Field(gt=0, le=2)] = 1.25
    """largest displacement from rest in x, y as a part of the robot's free_displacement limit"""
    motors_still: Still = 3e-3
    """m, peak to peak of an encoder length: a drive that gives way under the motion's tension"""
    tension_over: Annotated[float, Field(gt=0, le=1)] = 0.05
    """s, moving average over the current sensor's noise"""


class Reaction(StrEnum):
    """The reaction of all winches to a guard's trip."""

    HOLD = "hold"
    """stop on the ramp and hold with power on"""
    QUICK_STOP = "quick stop"
    REJECT_WINDOW = "reject window"
    """nothing at once: the window that is being recorded is rejected when it is checked, and recorded again"""
    WARN = "warn"
    """the run goes on, and everybody is told once"""


@dataclass(frozen=True)
class GuardSettings:
    """What stops a run at once. Every guard is checked in each cycle."""

    period: Annotated[float, Field(gt=0, le=0.1)] = 0.01
    """s between two looks"""
    sample_age: SampleAge = 0.2
    """s after which a winch sample is unknown"""
    slack: Slack = 0.1
    """lower tension threshold, as a part of the robot's lower limit"""
    overload: Overload = 1.25
    """upper tension threshold, as a part of the robot's upper limit"""
    hysteresis: NotNegative = 2.0
    """N by which a tension must come back before its violation is forgotten"""
    tension_for: TensionFor = 0.1
    """s for which a tension must be beyond its threshold"""
    slack_handled: SlackHandled = 2.0
    """s for which a cable may be slack while somebody handles the platform: so long a drum may pay out unseen"""
    current_stuck: Annotated[float, Field(gt=0, le=10)] = 1.0
    """s for which a motor current may stay exactly the same while its winch moves"""
    marker_for: MarkerFor = 3.0
    """s for which the main marker may be lost or frozen"""
    motion: MotionAllowed = 3e-3
    """m of cable by which an encoder may be off the place where it was told to be: a window with more is rejected"""
    motion_late: MotionLate = 0.06
    """s by which it may be early or late on its way: a following error of place over speed, bus and drive cycles"""
    motion_speed: MotionSpeed = 0.03
    """m/s besides what was commanded: a drum that holds under a swinging platform stays under 0.012"""
    motion_speed_for: MotionSpeedFor = 0.03
    """s: three looks; single values of a differentiated encoder are noise"""
    geometry: GeometryAllowed = 3e-3
    """m by which markers and lengths may contradict each other more than where they were compared; survey and turns of
    the platform come on top"""
    slip: Positive = 5e-3
    """m by which an encoder may leave its place while a window is recorded"""
    following_error: Positive = 0.015
    """m of cable by which a motor may be off the place that its drive wants: under the drive's own window"""
    following_error_for: FollowingErrorFor = 1.0
    """s: it is asked for twice a second"""
    temperature: DriveTemperature = 75.0
    """°C of a drive: most derate or trip at 80 to 90"""
    temperature_hysteresis: NotNegative = 5.0
    """K"""
    temperature_age: TemperatureAge = 30.0
    """s after which a temperature that was told before is missed"""
    bus_lost: BusLost = 25
    """bus cycles in a second that may bring no sample: a tenth at 250 Hz"""
    loop_late: LoopLate = 0.25
    """s between two looks: drives that hear no more of their host for so long stop by themselves"""
    disk_spare: NotNegative = 200e6
    """bytes that must be free: an hour of everything"""
    reactions: Mapping[str, Reaction] = field(default_factory=dict[str, Reaction])
    """by guard name, where it is not the guard's own"""


@dataclass(frozen=True)
class HoldSettings:
    """How a run ends, whatever ended it."""

    timeout: Annotated[float, Field(gt=0, le=30)] = 3.0
    """s for all winches to confirm the hold"""
    still_for: Annotated[float, Field(gt=0, le=10)] = 0.2
    """s for which encoders must stand still"""
    still: EncoderStill = 5e-4
    """m by which an encoder may move meanwhile"""


@dataclass(frozen=True)
class Settings:
    """All of them."""

    motion: MotionSettings = field(default_factory=MotionSettings)
    tension: TensionSettings = field(default_factory=TensionSettings)
    place: PlaceSettings = field(default_factory=PlaceSettings)
    hand: HandSettings = field(default_factory=HandSettings)
    excite: ExciteSettings = field(default_factory=ExciteSettings)
    record: RecordSettings = field(default_factory=RecordSettings)
    guard: GuardSettings = field(default_factory=GuardSettings)
    hold: HoldSettings = field(default_factory=HoldSettings)
    home: HomeSettings = field(default_factory=HomeSettings)
    taut: TautSettings = field(default_factory=TautSettings)
    align: AlignSettings = field(default_factory=AlignSettings)
    commission: CommissionSettings = field(default_factory=CommissionSettings)
    release: ReleaseSettings | None = None
    """None: the rig has none, a hand lets go"""
    prompt_estimate: float = 15.0
    """s that a person needs to answer a prompt, for the time estimate only"""
    steady_estimate: float = 15.0
    """s that a person needs to bring the platform to rest, likewise"""

    def estimate(self, prompt: Prompt) -> float:
        """s until a prompt is answered."""
        return self.steady_estimate if prompt.kind is PromptKind.STEADY else self.prompt_estimate
