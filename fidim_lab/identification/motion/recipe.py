"""The choices that turn recorded windows into a regressor, as one value: `PAPER` is the paper's, `BEST` is ours.

What differs, with what it is worth on `open-nothing-left-out` (0.1 mm noise; error of s_z, I_xx, I_yy, I_zz):

- **Where the 10 Hz low-pass acts.** The paper filters the *signals*; but a free motion at 2.5 Hz has harmonics beyond
  10 Hz, and cutting them biases every non-linear term. Here the signals keep 25 Hz and the *equations* W χ = 0 are
  filtered at 10 Hz: they hold at every instant, so a linear filter over time keeps them exact and removes the noise.
- **Weights of the equations.** Ξ⊥ᵀ of the coordinates x, y magnifies equations where x and y are nearly dependent,
  which are the worst ones. `BalanceRows.MARKER` writes the same equations as marker accelerations, m/s², where all are
  equally noisy (`rows.py`).
- **What is used of the marker.** x and y alone, or all of its coordinates (`Variant.SURFACE`).
"""

from dataclasses import dataclass
from enum import StrEnum

from fidim_lab.identification.motion.filters import LOW_PASS, WIDE, FilterDesign
from fidim_lab.identification.motion.filters import PAPER as PAPER_FILTER


class Variant(StrEnum):
    """How a window's markers become poses, twists and accelerations."""

    FREE = "free"
    """λ coordinates of the main marker, the others from the held lengths (Eq. 44, 45): the paper's first"""
    SURFACE = "surface"
    """all marker coordinates, fitted on the surface of the poses that the held lengths allow"""
    FULL = "full"
    """the markers alone, as a rigid body: the paper's second; needs three that are not in line, but no lengths"""


class BalanceRows(StrEnum):
    """In which coordinates the internal dynamics is written, which is how its equations are weighted."""

    FREE_COORDINATES = "free-coordinates"
    """Ξ⊥ of Eq. 6, with x, y as they come: the paper's"""
    MARKER = "marker"
    """as the smallest change of the measured marker accelerations that would fulfil it, m/s²"""


@dataclass(frozen=True)
class Recipe:
    """How W is made."""

    variant: Variant | None = None
    """None: full where the markers allow it, surface otherwise"""
    axes: tuple[int, ...] | None = None
    """free coordinates of `Variant.FREE` and of Ξ⊥ (0, 1, 2 = x, y, z of the marker); None: the best of each window"""
    rows: BalanceRows = BalanceRows.MARKER
    signals: FilterDesign = WIDE
    equations: FilterDesign | None = LOW_PASS
    """applied to W along time; None: not at all"""
    samples: int | None = 200
    """most samples per window after decimation; None: all"""
    max_condition: float = 25.0
    """samples at which the free coordinates are worse conditioned are not used"""
    reweight: int = 2
    """how often `BalanceRows.MARKER` is weighted anew with the body just found (the first weights come from CAD)"""


BEST = Recipe()
"""The default: filtered equations in marker accelerations."""

PAPER = Recipe(
    variant=Variant.FREE,
    axes=(0, 1),
    rows=BalanceRows.FREE_COORDINATES,
    signals=PAPER_FILTER,
    equations=None,
    samples=100,
    reweight=0,
)
"""§5.2 by its words: x and y filtered at 10 Hz, differentiated, decimated to 100 per window; no weights, no scaling."""
