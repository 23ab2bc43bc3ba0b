"""Lengths as `fidim doctor --rig` sees them: do their limits fit the robot, is the marker where they put it?"""

import numpy as np

from fidim_lab.app.compose.real import rig_settings
from fidim_lab.app.doctor.checks import Check, CheckVerdict
from fidim_lab.app.doctor.mocap_doctor import Watched
from fidim_lab.app.doctor.robot_plausibility import middle_rests
from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.errors import InfeasibleError
from fidim_lab.model.mechanism import Mechanism
from procedures.expected import NominalRest, PlaceHistory, SeenAtRest, place_measurements
from procedures.steps import Lengths

NAME = "marker and its place by the lengths"
HANGS = "does the platform hang freely and still from all cables?"


def check_place(file: RigFile, lengths: Lengths | None, watched: Watched | None) -> list[Check]:
    """lengths: m, by the encoders, None where one of them is not known; watched: what cameras saw, None: nothing."""
    settings = rig_settings(file).place
    wanted = f"at most {1e3 * settings.off:.0f} mm off"
    missing = "encoders or their zeros" if lengths is None else "the main marker"
    places = [] if watched is None else [f.positions[0] for f in watched.frames if f.positions and f.positions[0]]
    if lengths is None or not places:
        return [Check(NAME, CheckVerdict.WARNING, f"not compared: {missing} not known", "correct that first", wanted)]
    seen = np.array(places)
    if (swing := float(np.linalg.norm(np.ptp(seen, axis=0)))) > settings.off:
        found = f"not compared: the marker moves by {1e3 * swing:.0f} mm"
        return [Check(NAME, CheckVerdict.WARNING, found, "ask again when the platform is still", wanted)]
    try:
        found, cause = place_measurements(
            NominalRest(file.robot), SeenAtRest(lengths, np.median(seen, axis=0)), PlaceHistory(), settings
        )
    except InfeasibleError as refusal:
        says = f"no rest at these lengths: {refusal.message}"
        return [Check(NAME, CheckVerdict.FAILED, says, f"{HANGS} Are zeros, gears and drums right?", wanted)]
    verdict = CheckVerdict.FAILED if cause else CheckVerdict.OK
    off = found[0].value or 0.0
    return [Check(NAME, verdict, f"{1e3 * off:.1f} mm off", f"{HANGS} Then {cause}" if cause else "", wanted)]


def check_reach(file: RigFile) -> list[Check]:
    """Whether each winch may have the lengths with which the robot rests; nothing where it rests nowhere."""
    rests = middle_rests(Mechanism(file.robot))
    lengths = np.array([rest.lengths for rest in rests])
    checks: list[Check] = []
    for number, entry in enumerate(file.winches if rests else ()):
        low, high = entry.length_limits
        own = lengths[:, number]
        within = int(np.sum((own >= low) & (own <= high)))
        wanted = f"{own.min():.2f} to {own.max():.2f} m"
        found = f"{low:g} to {high:g} m: {within} of {len(rests)} places of rest under the middle of the anchors"
        verdict = CheckVerdict.OK if within == len(rests) else CheckVerdict.WARNING if within else CheckVerdict.FAILED
        advice = (
            "" if verdict is CheckVerdict.OK else "check length_limits (m of cable from D to A) and the robot file's d"
        )
        checks.append(Check("length_limits", verdict, found, advice, wanted, entry.name))
    return checks
