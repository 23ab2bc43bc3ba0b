"""The real noise of the markers, by fourth differences, compared with the robot file's."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Window
from fidim_lab.identification.data_checks.thresholds import DATA_CHECKS
from fidim_lab.identification.markers.clock_check import even_grid
from fidim_lab.identification.markers.finding import DefectKind, Finding, marker_channel
from fidim_lab.identification.markers.neighbours import noise_of


@dataclass(frozen=True, eq=False)
class NoiseLevels:
    """Standard deviations of white marker noise, m."""

    declared: float
    by_channel: Float[np.ndarray, "M 3"]
    """over all windows; the declared one where it cannot be seen"""
    by_window: Float[np.ndarray, "W M 3"]
    """NaN where it cannot be seen"""
    samples: Float[np.ndarray, " W"]

    @property
    def ratio(self) -> float:
        """What is seen over what is declared."""
        return float(np.median(self.by_channel)) / self.declared


def noise_levels(windows: tuple[Window, ...], declared: float) -> NoiseLevels:
    """Noise of every coordinate of every window (the windows of a campaign may show different numbers of markers)."""
    most = max((window.markers.shape[1] for window in windows), default=1)
    levels = np.full((len(windows), most, 3), np.nan)
    for w, window in enumerate(windows):
        if len(window.t) > 5:
            columns = even_grid(window.t).spread(window.markers.reshape(len(window.t), -1))
            levels[w, : window.markers.shape[1]] = noise_of(columns).reshape(-1, 3)
    by_channel = np.full((most, 3), declared)
    seen = np.isfinite(levels).any(axis=0)
    by_channel[seen] = np.nanmedian(levels[:, seen], axis=0)
    return NoiseLevels(declared, by_channel, levels, np.array([float(len(window.t)) for window in windows]))


def check_noise(windows: tuple[Window, ...], levels: NoiseLevels) -> tuple[Finding, ...]:
    """Differences between the noise and the robot file: over all, of one coordinate, of one window."""
    with np.errstate(divide="ignore"):
        logs = np.log(levels.by_window / levels.declared)
    sd = DATA_CHECKS.noise_check_spread * np.sqrt(1000 / np.maximum(levels.samples, 1))[:, np.newaxis, np.newaxis]
    seen = np.isfinite(logs)
    if not seen.any():
        return ()
    weights = np.where(seen, 1 / sd**2, 0.0)
    values = np.where(seen, logs, 0.0)
    overall = float((weights * values).sum() / weights.sum())
    found: list[Finding] = []
    if abs(overall) > max(
        DATA_CHECKS.noise_check_certain / np.sqrt(weights.sum()), np.log1p(DATA_CHECKS.noise_check_campaign)
    ):
        found.append(_finding(None, "x", np.exp(overall), levels.declared, "the markers' noise is", "declared"))
    per_channel = (weights * values).sum(axis=0) / np.maximum(weights.sum(axis=0), 1e-300)
    for m, axis in np.argwhere(seen.any(axis=0)):
        away = per_channel[m, axis] - overall
        if abs(away) > max(
            DATA_CHECKS.noise_check_certain / np.sqrt(weights[:, m, axis].sum()),
            np.log1p(DATA_CHECKS.noise_check_channel),
        ):
            ratio, name = float(np.exp(per_channel[m, axis])), marker_channel(int(m), int(axis))
            found.append(_finding(None, name, ratio, levels.declared, f"the noise of {name} is", "declared"))
    for w, window in enumerate(windows):
        for m in np.flatnonzero(seen[w].all(axis=1)):
            away = float((logs[w, m] - per_channel[m]).mean())
            if abs(away) > max(
                DATA_CHECKS.noise_check_certain * float(sd[w, 0, 0]) / np.sqrt(3),
                np.log1p(DATA_CHECKS.noise_check_window),
            ):
                ratio = float(np.exp(logs[w, m].mean()))
                says = f"window {window.id}: noise is"
                found.append(_finding(window, marker_channel(int(m), 0), ratio, levels.declared, says, "declared"))
    return tuple(found)


def _finding(window: Window | None, channel: str, ratio: float, declared: float, what: str, against: str) -> Finding:
    size = ratio * declared
    text = f"{what} {size * 1e3:.3g} mm by fourth differences, {ratio:.2f} times the {against} {declared * 1e3:.3g} mm."
    t = None if window is None else (float(window.t[0]), float(window.t[-1]))
    return Finding(
        DefectKind.NOISE, None if window is None else window.id, channel, t, size, "m", text[0].upper() + text[1:]
    )
