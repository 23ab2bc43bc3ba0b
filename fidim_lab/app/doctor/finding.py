"""What one check of a robot file found."""

from typing import NamedTuple


class RobotFinding(NamedTuple):
    """One check. A finding that is fine and still has advice is a warning: such a robot exists, but mind this."""

    what: str
    ok: bool
    found: str
    """a sentence with numbers"""
    advice: str = ""
    """what to do; a warning where `ok`"""
