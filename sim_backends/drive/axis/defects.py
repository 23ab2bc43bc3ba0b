"""What may be wrong with a drive that looks well: defects that only a trial finds (`fidim commission`)."""

from dataclasses import dataclass, fields


@dataclass
class Defects:
    """One drive's; a rehearsal sets them at any time. Parts of the drive look at them when it matters."""

    heartbeat_ignored: bool = False
    """1016 is accepted and does nothing"""
    sync_ignored: bool = False
    """1006 is accepted and does nothing"""
    quick_stop_ignored: bool = False
    """the controlword is; the drive goes on in OPERATION ENABLED"""
    ramp_ten_times_too_long: bool = False
    """a tenth of 6085, whatever it says"""
    halt_coasts: bool = False
    """the halt bit lets the shaft run down in seconds"""
    following_error_ignored: bool = False
    """6065 is accepted and does nothing"""
    limit_ignored: bool = False
    """607D is accepted and does nothing"""
    wrong_direction: bool = False
    """moves go the other way"""
    encoder_frozen: bool = False
    """6064 keeps the value that it has"""
    speed_frozen: bool = False
    """606C does"""
    demand_frozen: bool = False
    """6062 does: the motor runs away, and the drive does not want it to"""
    enables_itself: bool = False
    """some tenths of a second after a stop it is in OPERATION ENABLED again"""
    stops_in_words: bool = False
    """the statusword says so, the shaft goes on"""
    brake_open: bool = False
    """without power the shaft sags"""

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """As a line of `fidim simulators` names them, with blanks."""
        return tuple(field.name.replace("_", " ") for field in fields(cls))
