"""Lengths against markers, as `fidim doctor --rig` sees them: is the marker where the encoders' lengths put it?"""

import numpy as np

from fidim_lab.app.compose.real import rig_settings
from fidim_lab.app.doctor.checks import Check, Verdict
from fidim_lab.app.doctor.mocap_doctor import Watched
from fidim_lab.data.rigs.rig import RigFile
from fidim_lab.errors import InfeasibleError
from procedures.expected import NominalRest, PlaceHistory, Seen, place_measurements
from procedures.steps import Lengths

NAME = "marker against the lengths"
HANGS = "does the platform hang freely and still from all cables?"


def check_place(file: RigFile, lengths: Lengths | None, watched: Watched | None) -> list[Check]:
    """lengths: m, by the encoders, None where one of them is not known; watched: what cameras saw, None: nothing."""
    settings = rig_settings(file).place
    wanted = f"at most {1e3 * settings.off:.0f} mm off"
    missing = "encoders or their zeros" if lengths is None else "the main marker"
    places = [] if watched is None else [f.positions[0] for f in watched.frames if f.positions and f.positions[0]]
    if lengths is None or not places:
        return [Check(NAME, Verdict.WARNING, f"not compared: {missing} not known", "mend that first", wanted)]
    seen = np.array(places)
    if (swing := float(np.linalg.norm(np.ptp(seen, axis=0)))) > settings.off:
        found = f"not compared: the marker moves by {1e3 * swing:.0f} mm"
        return [Check(NAME, Verdict.WARNING, found, "ask again when the platform is still", wanted)]
    try:
        found, cause = place_measurements(
            NominalRest(file.robot), Seen(lengths, np.median(seen, axis=0)), PlaceHistory(), settings
        )
    except InfeasibleError as refusal:
        says = f"no rest at these lengths: {refusal.message}"
        return [Check(NAME, Verdict.FAILED, says, f"{HANGS} Are zeros, gears and drums right?", wanted)]
    verdict = Verdict.FAILED if cause else Verdict.OK
    off = found[0].value or 0.0
    return [Check(NAME, verdict, f"{1e3 * off:.1f} mm off", f"{HANGS} Then {cause}" if cause else "", wanted)]
