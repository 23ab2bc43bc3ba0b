"""Frequencies of the tones that are tried: scan points where the residual is largest, refined about the best."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fidim_lab.effects.loads.oscillation import SCAN
from fidim_lab.mismatch.linearised.columns import frequency_of
from fidim_lab.mismatch.linearised.hypotheses import Hypothesis
from fidim_lab.mismatch.residuals.residual import Leftover
from fidim_lab.mismatch.residuals.whiteness import spectrum
from fidim_lab.mismatch.scores.score import Score
from fidim_lab.mismatch.scores.thresholds import SCORES
from fidim_lab.mismatch.thresholds import SHARED


def likely_frequencies(leftovers: Sequence[Leftover], scan: Sequence[float]) -> frozenset[float]:
    """Where the residuals of all windows are largest: an unmodelled steady tone shows at its own frequency."""
    spectra = [spectrum(one) for one in leftovers if len(one.t) > SHARED.samples]
    if not spectra or len(scan) <= SCORES.frequencies_loudest:
        return frozenset(scan)
    width = max(s.frequencies[1] for s in spectra)
    loudness: dict[float, float] = {}
    for f in scan:
        near = [np.abs(s.frequencies - f) <= width for s in spectra]
        power = sum(float(s.chi2[rows].sum()) for s, rows in zip(spectra, near, strict=True))
        freedom = sum(float(s.dof[rows].sum()) for s, rows in zip(spectra, near, strict=True))
        loudness[f] = power / max(freedom, 1e-9)
    return frozenset(sorted(scan, key=lambda f: -loudness[f])[: SCORES.frequencies_loudest])


def between(scanned: Sequence[Hypothesis], tones: Sequence[Score], seconds: float) -> tuple[Hypothesis, ...]:
    """The best of these tones at frequencies between those of the scan, for windows of so many seconds.

    Half a step off, a tone near a mode comes out of phase at both ends of long windows, and a fit from there may end
    with phases that belong to no tone.
    """
    count = int(np.ceil(SCAN * seconds / SCORES.frequencies_turn))
    if not tones or count < 2:
        return ()
    best = max(tones, key=lambda tone: tone.log_evidence).tried[0]
    id, f = best.effect.id, frequency_of(best)
    simple = next(h for h in scanned if h.effect.id == id and frequency_of(h) == f)
    steps = SCAN * np.arange(1 - count, count) / count
    return tuple(replace(simple, absent=np.append(simple.absent[:-1], f + step)) for step in steps if step != 0)
