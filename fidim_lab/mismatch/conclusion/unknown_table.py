"""The model of unknown physics as it is kept in a file: words, figures, families, and the wrench along the motion.

unknown_table(found)        for explanation.json, under "unknown"; all SI, world frame
"""

from typing import Any

import numpy as np

from fidim_lab.mismatch.unknown_force.field import Field
from fidim_lab.mismatch.unknown_force.unknown import UnknownForce

MOST_SAMPLES = 600
"""of the wrench that are kept: fifty of each of twelve windows, enough for pictures"""

DIGITS = 5
"""significant, of what is drawn"""


def unknown_table(found: UnknownForce) -> dict[str, Any]:
    """Values that can be read without the program: numbers, strings, lists."""
    return {
        "words": found.words,
        "terms": [{"label": term.label, "confirmed": term.confirmed, "words": term.words} for term in found.terms],
        "explained": found.explained,
        "chi2_per_dof": {"before": found.before.chi2_per_dof, "after": found.after.chi2_per_dof},
        "rms_mm": {"before": 1e3 * found.before.rms, "after": 1e3 * found.after.rms},
        "tried": found.tried,
        "field": None if found.field is None else field_table(found.field.thinned(MOST_SAMPLES)),
    }


def field_table(field: Field) -> dict[str, Any]:
    """Columns of samples, as `Field` has them."""
    arrays = {name: value for name, value in vars(field).items() if isinstance(value, np.ndarray)}
    return {"windows": list(field.windows)} | {name: _rounded(value) for name, value in arrays.items()}


def _rounded(values: np.ndarray) -> list[Any]:
    """With a few significant digits of the largest: a file that a person may open."""
    largest = float(np.abs(values).max(initial=0.0))
    decimals = DIGITS - 1 - int(np.floor(np.log10(largest))) if largest > 0 else 0
    return np.round(values, decimals).tolist()
