"""`fidim reproduce --recordings --json`: "fidim-recordings-reproduction/1" (docs/reproduce.md)."""

import numpy as np

from benchmarks.reproduce import paper
from benchmarks.reproduce.recordings_found import FromRecordings
from benchmarks.reproduce.recordings_words import sentences
from benchmarks.reproduce.takes import TakesIdentified
from fidim_lab.data.records import PARAMETER_NAMES

FORMAT = "fidim-recordings-reproduction/1"


def to_json(found: FromRecordings) -> dict[str, object]:
    """Everything that is printed."""
    return {
        "eq46": {"paper": _printed(paper.FREE), "its_data": _identified(found.free, found.free.solution.percent)},
        "eq47": {"paper": _printed(paper.FULL), "its_data": _identified(found.full, found.full.printed_percent)},
        "eq49": {"paper": paper.ESSENTIAL_DIFFERENCE.tolist(), "its_data": found.difference.tolist()},
        "fig3": {
            "sigma_W": paper.FREE.sigma_W,
            "takes": [{"take": o.number, "sigma_perp": o.sigma, "mean_square": o.mean_square} for o in found.checked],
            "above": {
                "paper": paper.SIGMA_PERP_ABOVE,
                "eq50": found.above(printed=True),
                "mean_square": found.above(printed=False),
            },
        },
        "laboratory": {str(n): _named(body.vector) for n, body in found.laboratory.items()},
        "maximum_likelihood": [
            {
                "cables": list(one.cables),
                "values": _named(one.body.vector),
                "sd": _named(one.sd),
                "rms_mm": 1e3 * one.rms,
                "windows": one.takes,
            }
            for one in found.bodies
        ],
        "says": list(sentences(found)),
        "seconds": round(found.seconds, 3),
    }


def _printed(found: paper.Published) -> dict[str, object]:
    return {
        "values": _named(found.values),
        "sd_percent": _named(found.percent),
        "sigma_W": found.sigma_W,
        "C": found.C,
    }


def _identified(found: TakesIdentified, percent: np.ndarray) -> dict[str, object]:
    return {
        "values": _named(found.solution.values),
        "sd_percent": _named(percent),
        "sigma_W": found.solution.sigma_W,
        "C": found.solution.C,
        "equations": found.solution.rows,
        "takes": list(found.takes),
        "left_out": {str(number): why for number, why in found.left_out.items()},
    }


def _named(values: np.ndarray) -> dict[str, float]:
    return dict(zip(PARAMETER_NAMES, map(float, values), strict=True))
