"""The tables of one winch in a rig file. `WinchSettings` is the part that the driver takes as it is.

What each key means, and its unit: docs/file-keys.md, from `fidim_lab/app/formats/key_words.toml`.
"""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from fidim_lab.data.files.toml_file import Count, Name, NotNegative, Positive, Table

GENERIC = "generic"
"""the name of the built-in EDS"""


class TensionTable(Table):
    """`tension` of a winch: cable tension from the motor current I: gain · I + offset, within ± friction.

    Without a gain the robot file's drum, gear, efficiency and torque constant count. With a scatter, friction is the
    part that changes sign with the direction D of the last move (+1 paid out):
    (gain · I + offset + D · friction) / (1 − D · load_friction), within ± scatter.
    """

    gain: Positive | None = None
    offset: float = 0.0
    friction: NotNegative | None = None
    load_friction: Annotated[float, Field(gt=-0.9, lt=0.9)] = 0.0
    scatter: NotNegative | None = None

    @model_validator(mode="after")
    def _whole(self) -> "TensionTable":
        if self.friction is None and (self.scatter is not None or self.load_friction):
            raise ValueError("friction: is missing; scatter and load_friction are what remains besides it")
        return self


class TemperatureObject(Table):
    """`temperature` of a winch: a vendor object."""

    index: Annotated[int, Field(ge=0x2000, le=0xFFFF)]
    sub: Annotated[int, Field(ge=0, le=255)] = 0
    scale: Positive = 1.0


class Signal(Table):
    """`sto`, `brake_output` of a winch: a bit of 60FD or 60FE."""

    bit: Annotated[int, Field(ge=0, le=31)]
    active: Literal[0, 1] = 1

    def is_active(self, word: int) -> bool:
        """Whether it is, in a word of all inputs or outputs."""
        return (word >> self.bit & 1) == self.active

    def put(self, word: int, active: bool) -> int:
        """The word with this bit as it must be."""
        level = self.active if active else 1 - self.active
        return word & ~(1 << self.bit) | level << self.bit


class StopReactions(Table):
    """`stop` of a winch: CiA 402 option codes."""

    # Written and read back before power is allowed. None may be 0: a coasting winch drops its load.
    quick_stop: Annotated[int, Field(ge=1, le=8)] = 6
    halt: Annotated[int, Field(ge=1, le=4)] = 1
    fault: Annotated[int, Field(ge=1, le=4)] = 2
    connection_lost: Literal[3] = 3
    communication_error: Literal[0, 1] = 1

    @property
    def holds_in_quick_stop(self) -> bool:
        """Whether the drive keeps holding its load in quick stop."""
        return self.quick_stop >= 5


class WinchSettings(Table):
    """What a rig file says of a winch and its driver takes as it is; SI units."""

    name: Name
    node_id: Annotated[int, Field(ge=1, le=126)]
    direction: Literal[-1, 1] = 1
    reversed: bool = False
    drum_radius: Positive
    rated_current: Positive
    rated_torque: Positive | None = None
    current_limit: Positive
    length_limits: tuple[NotNegative, Positive]
    max_speed: Positive
    max_acceleration: Positive
    quick_stop_deceleration: Positive = 2.0
    following_error: Positive = 0.02
    following_error_time: Annotated[float, Field(ge=0.001, le=65)] = 0.05
    home_count: Count = 0
    home_length: float = 0.0
    heartbeat: Annotated[float, Field(ge=0.001, le=65)] = 0.1
    host_timeout: Annotated[float, Field(ge=0.001, le=65)] = 0.25
    sdo_timeout: Annotated[float, Field(ge=0.05, le=10)] = 0.5
    vendor_id: Annotated[int, Field(ge=0)] | None = None
    product_code: Annotated[int, Field(ge=0)] | None = None
    serial_number: Annotated[int, Field(ge=0)] | None = None
    temperature: TemperatureObject | None = None
    sto: Signal | None = None
    brake_output: Signal | None = None
    stop: StopReactions = StopReactions()

    @model_validator(mode="after")
    def _ordered(self) -> "WinchSettings":
        low, high = self.length_limits
        if low >= high:
            raise ValueError(f"length_limits: the shortest, {low:g} m, is not below the longest, {high:g} m")
        if self.current_limit > 10.0 * self.rated_current:
            raise ValueError(
                f"current_limit: {self.current_limit:g} A is more than ten times the rated {self.rated_current:g} A"
            )
        return self


class RigWinchTable(WinchSettings):
    """`[[winch]]`, with what `[every_winch]` says filled in."""

    eds: Name = GENERIC
    counts_per_turn: Positive
    gear_ratio: Positive = 1.0
    brake_time: Annotated[float, Field(ge=0, le=10)] = 0.0
    mode: Literal["profile-position", "cyclic-position"] = "profile-position"
    family: Name = "generic"
    load: Literal["current", "torque"] | None = None
    encoder: Literal["multi-turn", "incremental"] = "incremental"
    turned: NotNegative = 2e-3
    tension: TensionTable = TensionTable()

    @model_validator(mode="after")
    def _torque_rated(self) -> "RigWinchTable":
        if self.load == "torque" and self.rated_torque is None:
            raise ValueError("rated_torque: is missing; a drive reports its torque as a fraction of it (load)")
        return self
