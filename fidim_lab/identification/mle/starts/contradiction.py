"""Windows whose lengths contradict their markers while those of the others agree: an encoder slipped, for example.

One such window bends the fit of all. Where every window contradicts, it is the geometry or the cables' stretch instead:
that is for the fit to bear and for `fidim explain` to name, and nothing is left out.
"""

from collections.abc import Sequence

import numpy as np

from fidim_lab.data.records import Window
from fidim_lab.errors import RefusedError
from fidim_lab.identification.mle.starts.start import Guess, first_guesses
from fidim_lab.identification.mle.trajectories.recordings import FollowedSamples, prepare
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.units import millimetres

APART = 2e-3
"""m between lengths and markers at the start of a window, up to which nothing is left out"""
FAR_MORE = 10.0
"""times what the better half of the windows shows"""


def contradicting(mechanism: Mechanism, windows: Sequence[Window]) -> dict[str, str]:
    """Window id → a sentence, for each window that contradicts itself while most do not.

    Windows that cannot be prepared or have no first guess are not judged here.
    """
    recordings = _prepared(mechanism, windows)
    if len(recordings) < 2:
        return {}
    guesses = first_guesses(mechanism, mechanism.robot.nominal, recordings)
    misfits = {
        recording.window.id: (guess.misfit, recording)
        for recording, guess in zip(recordings, guesses, strict=True)
        if isinstance(guess, Guess)
    }
    if len(misfits) < 2:
        return {}
    sizes = sorted(size for size, _ in misfits.values())
    usual = sizes[(len(sizes) - 1) // 2]
    return {
        name: _sentence(recording, size, usual)
        for name, (size, recording) in misfits.items()
        if size > max(APART, FAR_MORE * usual)
    }


def _prepared(mechanism: Mechanism, windows: Sequence[Window]) -> list[FollowedSamples]:
    found: list[FollowedSamples] = []
    for window in windows:
        try:
            recording = prepare(window, mechanism.robot)
        except RefusedError:
            continue
        if np.isfinite(recording.lengths).any():
            found.append(recording)
    return found


def _sentence(recording: FollowedSamples, size: float, usual: float) -> str:
    return (
        f"Window {recording.window.id}: its cable lengths and its markers miss each other by "
        f"{millimetres(size):.1f} mm at its start ({recording.window.t[0] + recording.begin:.2f} s), those of the "
        f"other windows by {millimetres(usual):.1f} mm. An encoder slipped, or these are not its markers."
    )
