"""Pictures that prove an explanation: residuals and spectra before and after, moved parameters, the force as arrows."""

from collections.abc import Sequence

import numpy as np

from fidim_lab.app.formats.explanation_file import ExplanationTable
from fidim_lab.app.report.contents.proof import ComparedWindow, ProofOfCause
from fidim_lab.app.report.drawings import spectra
from fidim_lab.app.report.drawings.drawing import Drawing
from fidim_lab.app.report.drawings.figures import WIDTH, legend, plain_ticks, sd_levels
from fidim_lab.app.report.drawings.svg import COLOURS, sheet, styled, thin, to_svg
from fidim_lab.identification.mle.judge import Remainder
from fidim_lab.mismatch.unknown_force.field import Field
from fidim_lab.units import millimetres

ARROWS = 220
VIEWS = (("from above", 0, 1), ("from the side", 0, 2), ("from the front", 1, 2))


def drawings(shown: ProofOfCause, noise: float) -> tuple[Drawing, ...]:
    """The mean spectrum, then the courses of the window that the model before missed most."""
    if not shown.windows:
        return ()
    worst = max(shown.windows, key=lambda one: one.before.chi2_per_dof)
    after = "" if worst.after is None else ", before and after"
    pictures = [
        Drawing(_courses(worst), f"Window {worst.window.id}: recorded − model of the main marker{after}.", "residuals"),
    ]
    if (mean := mean_spectrum(shown, noise)) is not None:
        ids = ", ".join(one.window.id for one in shown.windows)
        said = f"Spectrum of recorded − model, main marker, mean of {ids}{after}; dotted: noise alone."
        pictures.insert(0, Drawing(mean, said, "spectra"))
    return tuple(pictures)


def mean_spectrum(shown: ProofOfCause, noise: float) -> str | None:
    """Spectra without and with the effects over one another; None where too little was recorded."""
    both = [
        _mean("before", [one.before for one in shown.windows]),
        _mean("after", [one.after for one in shown.windows if one.after is not None]),
    ]
    known = [one for one in both if one is not None]
    if not known:
        return None
    samples = int(np.median([np.isfinite(one.before.residuals[:, 0, 0]).sum() for one in shown.windows]))
    return spectra.picture(known, spectra.noise_level(noise, samples, 3))


def _mean(label: str, remainders: Sequence[Remainder]) -> spectra.LabelledSpectrum | None:
    found = [spectra.amplitudes(label, one.t, one.residuals[:, 0]) for one in remainders]
    return spectra.mean(label, [one for one in found if one is not None])


@styled
def _courses(one: ComparedWindow) -> str:
    figure, axes = sheet(WIDTH, 4.6, rows=3)
    for k, (axis, name) in enumerate(zip(axes, "xyz", strict=True)):
        for number, (label, left) in enumerate((("before", one.before), ("after", one.after))):
            if left is not None:
                line = thin(left.t, millimetres(1.0) * left.residuals[:, 0, k])
                axis.plot(*line, color=COLOURS[number], lw=0.9, label=label)
        axis.axhline(0.0, color="black", lw=0.6)
        axis.set_ylabel(f"Δ{name} / mm")
    legend(axes[0], 2)
    axes[-1].set_xlabel("t / s")
    return to_svg(figure)


def shifts(found: ExplanationTable) -> Drawing:
    """How far each parameter moved, in sd of the fit before, on a scale that shows 1 and 1000 alike."""
    svg = _shifts(found)
    return Drawing(
        svg, "How far the parameters moved, in standard deviations of the fit before; dotted: two.", "shifts"
    )


@styled
def _shifts(found: ExplanationTable) -> str:
    names = list(found.parameters)
    pairs = [(found.parameters_before[name], found.parameters[name]) for name in names]
    moved = [(after.value - before.value) / max(before.sd, 1e-300) for before, after in pairs]
    figure, (axis,) = sheet(WIDTH, 2.4)
    axis.bar(range(len(names)), moved, color=COLOURS[0], width=0.6)
    axis.set_yscale("symlog", linthresh=3.0)
    axis.set_yticks(sd_levels(min(*moved, -2.0), max(*moved, 2.0)))
    plain_ticks(axis.yaxis)
    axis.axhline(0.0, color="black", lw=0.6)
    for level in (-2.0, 2.0):
        axis.axhline(level, color="black", lw=0.8, ls=":")
    axis.set_xticks(range(len(names)), names)
    axis.grid(visible=False, axis="x")
    axis.set_ylabel("moved / sd")
    return to_svg(figure)


def field_drawings(field: Field) -> tuple[Drawing, ...]:
    """The unknown force as arrows at the centre of mass along the recorded motions, and what it feeds in over time."""
    most = float(np.linalg.norm(field.forces, axis=1).max(initial=0.0))
    views = tuple(
        Drawing(
            _arrows(field, first, second),
            f"The force on the platform {seen}; the longest arrow is {most:.2g} N. Grey: the centre of mass.",
            f"force-{seen}",
        )
        for seen, first, second in VIEWS
    )
    caption = "Size of the force, and of the torque about G, over time; a line for each window."
    return (*views, Drawing(_over_time(field), caption, "force-size"))


@styled
def _arrows(field: Field, first: int, second: int) -> str:
    figure, (axis,) = sheet(4.6, 3.6)
    axis.plot(field.centres[:, first], field.centres[:, second], ".", color="0.8", ms=1.5)
    few = field.thinned(ARROWS)
    size = max(float(np.linalg.norm(field.forces, axis=1).max(initial=0.0)), 1e-300)
    spread = float(np.ptp(field.centres, axis=0).max())
    scale = 0.25 * (spread or 1.0) / size
    axis.quiver(
        few.centres[:, first], few.centres[:, second], scale * few.forces[:, first], scale * few.forces[:, second],
        color=COLOURS[2], angles="xy", scale_units="xy", scale=1.0, width=0.004,
    )  # fmt: skip
    axis.set_aspect("equal", adjustable="datalim")
    axis.margins(0.15)
    axis.set_xlabel(f"{'xyz'[first]} / m")
    axis.set_ylabel(f"{'xyz'[second]} / m")
    return to_svg(figure)


@styled
def _over_time(field: Field) -> str:
    figure, axes = sheet(WIDTH, 3.4, rows=2)
    sizes = (np.linalg.norm(field.forces, axis=1), np.linalg.norm(field.torques, axis=1))
    ids = list(dict.fromkeys(field.windows))
    of_window = np.array(field.windows)
    for axis, values, name in zip(axes, sizes, ("force / N", "torque / (N m)"), strict=True):
        for id in ids:
            there = of_window == id
            axis.plot(*thin(field.t[there], values[there]), lw=0.6, color=COLOURS[0], alpha=0.5)
        axis.set_ylabel(name)
        axis.set_ylim(bottom=0.0)
    axes[-1].set_xlabel("t / s")
    return to_svg(figure)
