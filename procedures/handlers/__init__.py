"""One handler for each type of step, in a table: a laboratory's own step adds its own line."""

from collections.abc import Awaitable, Callable, Mapping
from types import MappingProxyType
from typing import Any

from procedures.handlers.accuracy import check_accuracy, identify_body
from procedures.handlers.align import jog
from procedures.handlers.commission import prove_stop
from procedures.handlers.excitation import see_recorded_swing, strokes, think, watch_swing
from procedures.handlers.hand import ask, await_hands_off
from procedures.handlers.home import configure, measure_pose, set_lengths
from procedures.handlers.motion import enable, hold, move_to
from procedures.handlers.placing import compare_place, try_winches
from procedures.handlers.release import await_held, let_go, take_hold
from procedures.handlers.rest import check_tension, read_encoders, settle
from procedures.handlers.taut import take_power, take_up
from procedures.handlers.window import accept, check_window, give_up, note, record, reject
from procedures.stand import Stand
from procedures.steps import (
    Accept,
    Ask,
    AskWithoutPower,
    AwaitHandsOff,
    AwaitHeld,
    CheckTension,
    CheckWindow,
    Configure,
    Enable,
    GiveUp,
    GiveUpWithoutPower,
    Hold,
    LetGo,
    MeasurePose,
    MoveTo,
    Note,
    ReadEncoders,
    Record,
    Reject,
    Result,
    SetLengths,
    Settle,
    Step,
    TakeHold,
)
from procedures.steps.accuracy import CheckAccuracy
from procedures.steps.align import Jog, Told
from procedures.steps.commission import ProveStop
from procedures.steps.excitation import IdentifyBody, SeeRecordedSwing, Strokes, Think, WatchSwing
from procedures.steps.placing import ComparePlace, TryWinches
from procedures.steps.taut import TakePower, TakeUp

Handler = Callable[[Stand, Any], Awaitable[Result]]

HANDLERS: Mapping[type[Step], Handler] = MappingProxyType(
    {
        Enable: enable,
        TryWinches: try_winches,
        ComparePlace: compare_place,
        MoveTo: move_to,
        Settle: settle,
        Hold: hold,
        ReadEncoders: read_encoders,
        CheckTension: check_tension,
        Ask: ask,
        TakeHold: take_hold,
        AwaitHeld: await_held,
        LetGo: let_go,
        AwaitHandsOff: await_hands_off,
        Record: record,
        Configure: configure,
        AskWithoutPower: ask,
        MeasurePose: measure_pose,
        SetLengths: set_lengths,
        CheckWindow: check_window,
        Accept: accept,
        Reject: reject,
        GiveUp: give_up,
        GiveUpWithoutPower: give_up,
        Note: note,
        Strokes: strokes,
        WatchSwing: watch_swing,
        SeeRecordedSwing: see_recorded_swing,
        Think: think,
        CheckAccuracy: check_accuracy,
        IdentifyBody: identify_body,
        Jog: jog,
        ProveStop: prove_stop,
        TakeUp: take_up,
        TakePower: take_power,
        Told: give_up,
    }
)
"""`Stop` has none: it ends the run, which is the engine's own matter."""
