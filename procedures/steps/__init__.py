"""The steps of procedures: frozen values, so that not only the engine can read them.

Listing, limit check, time estimate and report read the same steps. A procedure is a generator that yields steps and is
sent the `Result` of each; a reader without hardware sends `step.expected`. Lengths are m, in the order of the winches.
"""

from procedures.steps.base import AfterPause, Lengths, Phase, Procedure, Result, Step, Steps
from procedures.steps.home import AskWithoutPower, Configure, GiveUpWithoutPower, MeasurePose, SetLengths
from procedures.steps.person import Ask, AwaitHandsOff
from procedures.steps.release import AwaitHeld, LetGo, TakeHold
from procedures.steps.robot import CheckTension, Enable, Hold, MoveTo, ReadEncoders, Settle, longest_way, travel_time
from procedures.steps.window import SLIPPED, Accept, CheckWindow, GiveUp, Note, Record, Reject, Stop, WindowLimits

__all__ = [
    "SLIPPED",
    "Accept",
    "AfterPause",
    "Ask",
    "AskWithoutPower",
    "AwaitHandsOff",
    "AwaitHeld",
    "CheckTension",
    "CheckWindow",
    "Configure",
    "Enable",
    "GiveUp",
    "GiveUpWithoutPower",
    "Hold",
    "Lengths",
    "LetGo",
    "MeasurePose",
    "MoveTo",
    "Note",
    "Phase",
    "Procedure",
    "ReadEncoders",
    "Record",
    "Reject",
    "Result",
    "SetLengths",
    "Settle",
    "Step",
    "Steps",
    "Stop",
    "TakeHold",
    "WindowLimits",
    "longest_way",
    "travel_time",
]
