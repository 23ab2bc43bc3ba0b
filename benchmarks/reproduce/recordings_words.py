"""What `fidim reproduce --recordings` says of what differs, one sentence each."""

import numpy as np

from benchmarks.reproduce import paper
from benchmarks.reproduce.recordings_found import FromRecordings
from fidim_lab.data.records import PARAMETER_NAMES
from fidim_lab.units import millimetres

DIGITS = (4, 4, 3, 4, 4, 4, 6, 5, 5)
"""decimals to which Eq. 47 is printed, by parameter"""
ALIKE = 2.5
"""± beyond which a body by other cables differs"""


def sentences(found: FromRecordings) -> tuple[str, ...]:
    """All of them."""
    return (*found.missing, *_eq47(found), *_eq46(found), *_eq49(found), *_fig3(found), *_bodies(found))


def _eq47(found: FromRecordings) -> tuple[str, ...]:
    full, printed = found.full, paper.FULL
    each = zip(full.solution.values, printed.values, DIGITS, strict=True)
    same = sum(abs(ours - theirs) <= 0.51 * 10.0**-digits for ours, theirs, digits in each)
    decimated = found.decimated
    smaller = 100 * (1 - float(np.median(full.solution.percent / full.printed_percent)))
    return (
        f"Eq. 47: {same} of 9 values agree to the printed digits, C is {full.solution.C:.3f} (printed {printed.C}). "
        f"They come from {len(full.takes)} takes with every sample ({full.solution.rows} equations, not 2400) and "
        "gravity along the calibrated axis.",
        "Eq. 47, σ%: with 1 + ‖χ‖ in Eq. 32, as the laboratory computed it; with 1 + ‖χ‖² as printed each is "
        f"{smaller:.1f} % smaller.",
        f"Eq. 47, σ_W: {full.solution.sigma_W:.3f} with every sample; with 100 samples of each of the first "
        f"{len(decimated.takes)} takes {decimated.solution.sigma_W:.3f}. The printed {printed.sigma_W} is of that "
        "form, not of the values beside it.",
    )


def _eq46(found: FromRecordings) -> tuple[str, ...]:
    free, printed = found.free, paper.FREE
    off = np.abs(free.solution.values / printed.values - 1)[:6]
    worst = int(np.argmax(off))
    said = [
        f"Eq. 46: the essential parameters agree within {100 * off[worst]:.1f} % ({PARAMETER_NAMES[worst]} is off "
        f"most), C is {free.solution.C:.2f} (printed {printed.C}), σ_W {free.solution.sigma_W:.3f} "
        f"({printed.sigma_W}), from takes {', '.join(map(str, free.takes))}. Which twelve of its fifteen takes the "
        "paper used, and how it solved Eq. 44, is not stated.",
    ]
    if free.left_out:
        why = "; ".join(f"{number}: {reason}" for number, reason in free.left_out.items())
        said.append(f"Eq. 46 leaves out takes in which x and y hardly determine the pose ({why}).")
    return tuple(said)


def _eq49(found: FromRecordings) -> tuple[str, ...]:
    worst = int(np.argmax(found.difference))
    return (
        f"Eq. 49: free and full differ most in {PARAMETER_NAMES[worst]} ({found.difference[worst]:.1f} %), in the "
        "paper in s_x (21.1 %). These are differences of small numbers: 0.1 mm of s_x is 5 %.",
    )


def _fig3(found: FromRecordings) -> tuple[str, ...]:
    if not found.checked:
        return ()
    largest = max(found.checked, key=lambda one: one.sigma)
    return (
        f"Fig. 3: by Eq. 50 as printed {found.above(printed=True)} of {len(found.checked)} takes are above σ_W, by the "
        f"mean of ε² (two equations a sample) {found.above(printed=False)}; the paper says {paper.SIGMA_PERP_ABOVE} of "
        f"{paper.CROSS_VALIDATION_WINDOWS}. Take {largest.number} is the largest ({largest.sigma:.2f}). Takes 12, 20 "
        "and 31 are in both of the paper's lists.",
    )


def _bodies(found: FromRecordings) -> tuple[str, ...]:
    if not found.bodies:
        return ()
    best = found.bodies[-1]
    off = (paper.FULL.values - best.body.vector) / best.sd
    worst = int(np.argmax(np.abs(off)))
    said = [
        f"Maximum likelihood on the same takes, with {best.takes} windows of "
        f"{' + '.join(map(str, best.cables))} cables: s_z {millimetres(best.body.com[2]):.2f} ± "
        f"{millimetres(best.sd[2]):.2f} mm. Eq. 47 is {abs(off[worst]):.1f} of these ± away in "
        f"{PARAMETER_NAMES[worst]}, the most of all parameters.",
    ]
    for one in found.bodies[:-1] if len(found.bodies) > 1 else ():
        apart = np.abs(one.body.vector - best.body.vector) / np.hypot(one.sd, best.sd)
        names = [PARAMETER_NAMES[k] for k in np.flatnonzero(apart > ALIKE)]
        verdict = f"differs from all together in {', '.join(names)}" if names else "agrees with all together"
        said.append(f"The body by {one.cables[0]} cables {verdict} (rms {millimetres(one.rms):.2f} mm).")
    return tuple(said)
