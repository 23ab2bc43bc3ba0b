"""Scores of periodic effects whose phase is different in every window.

Of each window the amplitudes x = (s, c) of sin and cos that suit it best follow from its gradient g and curvature H.
One amplitude A for all with a phase φ of each window, x = R(φ) A, turns them in the plane of sin and cos; A and the φ
are found in turn. A tone that is the same in all windows takes nearly all that tones of their own would; what is left
of something else, at the frequencies at which a platform swings, is larger where it swings more. What the body could
take up is left out of account: a tone whose phase differs from window to window is nothing that a body's parameters do.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from fidim_lab.data.records import Robot
from fidim_lab.effects.catalogue import by_id
from fidim_lab.effects.effect import NamedEffect
from fidim_lab.mismatch.linearised.hypotheses import PERIODIC, Hypothesis
from fidim_lab.mismatch.scores.score import Projected, Score, WindowGram
from fidim_lab.mismatch.scores.thresholds import SCORES


def own_phase_scores(found: Projected, grams: Sequence[WindowGram], robot: Robot) -> tuple[Score, ...]:
    """Of each periodic hypothesis the one with own phases, where it says more than the one with the same phase."""
    wide = {id: one for id in PERIODIC if (one := _with_own_phase(robot, id)) is not None}
    if len(grams) < 2:
        return ()
    scores: list[Score] = []
    for tried, place in zip(found.tried, found.slices, strict=True):
        effect = wide.get(tried.effect.id)
        if effect is not None and tried.effect.id in PERIODIC:
            windows = _turned(grams, place)
            score = _score(found, windows, replace(tried, effect=effect))
            scores += [score] if score.gain > SCORES.by_a_tone * _own_gain(*windows, found.inflation) else []
    return tuple(scores)


def _own_gain(curvature: np.ndarray, gradient: np.ndarray, inflation: float) -> float:
    """χ² that amplitudes of each window would take, beyond what they take of noise."""
    scale = np.sqrt(np.maximum(np.einsum("wii->wi", curvature), 1e-300))
    scaled = curvature / (scale[:, :, np.newaxis] * scale[:, np.newaxis]) + 1e-9 * np.eye(6)
    own = np.linalg.solve(scaled, (gradient / scale)[..., np.newaxis])[..., 0]
    return float(np.einsum("wi,wi->", own, gradient / scale)) - inflation * gradient.size


def _with_own_phase(robot: Robot, id: str) -> NamedEffect | None:
    return next((effect for effect in by_id(robot, id) if effect.of_each_window), None)


def _turned(grams: Sequence[WindowGram], place: slice) -> tuple[np.ndarray, np.ndarray]:
    """Curvature (W, 6, 6) and downhill gradient (W, 6) of half of χ² of each window by its amplitudes."""
    shared = len(grams[0].shared)
    at = slice(shared + place.start, shared + place.stop)
    return np.stack([one.gram[at, at] for one in grams]), -np.stack([one.gram[at, -1] for one in grams])


def _score(found: Projected, windows: tuple[np.ndarray, np.ndarray], tried: Hypothesis) -> Score:
    curvature, gradient = windows
    amplitude, phases = _found(curvature, gradient, tried.prior_sd)
    turns = rotations(phases)
    turned = np.swapaxes(turns, 1, 2) @ curvature @ turns
    downhill = np.einsum("wji,wj->wi", turns, gradient).sum(axis=0)
    gain = float(2 * downhill @ amplitude - amplitude @ turned.sum(axis=0) @ amplitude)
    inflation, prior = found.inflation, tried.prior_sd
    wide = prior[:, np.newaxis] * turned.sum(axis=0) * prior / inflation
    cost = 0.5 * float(np.linalg.slogdet(np.eye(6) + wide)[1])
    quarter = np.concatenate([-amplitude[3:], amplitude[:3]])
    certain = np.einsum("i,wij,j->w", quarter, turned, quarter) / inflation
    cost += 0.5 * float(np.log(np.maximum(2 * np.pi * certain, 1.0)).sum())
    surprise = 0.5 * float(((amplitude / prior) ** 2).sum())
    share = gain / max(found.left - found.dof, 1e-12)
    return Score((tried,), (amplitude,), gain, 0.5 * gain / inflation - cost - surprise, share, phases)


def _found(curvature: np.ndarray, gradient: np.ndarray, prior: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Amplitude (6) and phases (W), from the strongest common direction of the windows' own amplitudes on."""
    ridge = np.diag(prior**-2.0)
    own = np.linalg.solve(curvature + ridge, gradient[..., np.newaxis])[..., 0]
    weight = np.sqrt(np.maximum(np.einsum("wi,wi->w", own, gradient), 0.0))
    size = np.maximum(np.linalg.norm(own, axis=1), 1e-300)
    # s sin θ + c cos θ is the real part of (c − i s) exp(i θ)
    pointers = (own[:, 3:] - 1j * own[:, :3]) * (weight / size)[:, np.newaxis]
    phases = np.angle(np.linalg.svd(pointers, full_matrices=False)[0][:, 0])
    amplitude = np.zeros(6)
    angles = np.linspace(-np.pi, np.pi, SCORES.own_phase_phases, endpoint=False)
    every = rotations(angles)
    for _ in range(SCORES.own_phase_rounds):
        turns = rotations(phases)
        total = (np.swapaxes(turns, 1, 2) @ curvature @ turns).sum(axis=0) + ridge
        amplitude = np.linalg.solve(total, np.einsum("wji,wj->i", turns, gradient))
        pointed = every @ amplitude
        gains = 2 * gradient @ pointed.T - np.einsum("ai,wij,aj->wa", pointed, curvature, pointed)
        phases = angles[np.argmax(gains, axis=1)]
    return amplitude, phases


def rotations(phases: Float[np.ndarray, " W"]) -> Float[np.ndarray, "W 6 6"]:
    """R(φ): (s, c) of s sin(θ + φ) + c cos(θ + φ) in sin θ and cos θ."""
    cosine, sine = np.cos(phases), np.sin(phases)
    plane = np.stack([np.stack([cosine, -sine], axis=-1), np.stack([sine, cosine], axis=-1)], axis=-2)
    return np.einsum("wij,kl->wikjl", plane, np.eye(3)).reshape(len(phases), 6, 6)
