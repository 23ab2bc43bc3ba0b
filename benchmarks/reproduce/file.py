"""`fidim reproduce --json`: "fidim-reproduction/1" (docs/reproduce.md)."""

from benchmarks.reproduce import paper
from benchmarks.reproduce.simulated import IdentifiedRun, Places, Reproduction, essential_difference
from benchmarks.reproduce.words import sentences
from fidim_lab.data.records import PARAMETER_NAMES

FORMAT = "fidim-reproduction/1"


def to_json(found: Reproduction) -> dict[str, object]:
    """Everything that is printed, and the noise-free identification of Table 2; what is unknown is null."""
    free = found.random.free
    return {
        "marker_noise": found.noise,
        "truth": _named(paper.FREE.values.tolist()),
        "eq46": {"paper": _published(paper.FREE), **_readings(found, 46)},
        "eq47": {"paper": _published(paper.FULL), **_readings(found, 47)},
        "eq49": {
            "paper": paper.ESSENTIAL_DIFFERENCE.tolist(),
            "table2": _difference(found.table2),
            "random": _difference(found.random),
        },
        "fig3": {
            "paper": {"windows": paper.CROSS_VALIDATION_WINDOWS, "above_sigma_W": paper.SIGMA_PERP_ABOVE},
            "sigma_W": free.sigma_W if isinstance(free, IdentifiedRun) else None,
            "expected": found.expected,
            "sigma_perp": found.sigma_perps,
        },
        "C_without_noise": {"paper": paper.OPTIMUM_C, "ours": found.cost},
        "optimised": [
            {
                "id": w.planned.id,
                "lengths": w.planned.lengths.tolist(),
                "displacement": w.planned.displacement.tolist(),
                "conditioning": w.conditioning,
                "worst_conditioning": w.worst_conditioning,
                "tension": list(w.tension),
            }
            for w in found.optimised
        ],
        "says": list(sentences(found)),
        "seconds": round(found.seconds, 3),
    }


def _readings(found: Reproduction, equation: int) -> dict[str, object]:
    return {name: _reading(reading) for name, reading in found.columns(equation).items()}


def _reading(reading: IdentifiedRun | str) -> dict[str, object]:
    if isinstance(reading, str):
        return {"refused": reading}
    return {
        "values": _named(reading.values.tolist()),
        "sd_percent": _named(reading.percent.tolist()),
        "error_percent": _named(reading.error_percent(paper.FREE.body).tolist()),
        "sigma_W": reading.sigma_W,
        "C": reading.C,
        "windows": list(reading.used),
        "unused": reading.unused,
    }


def _published(found: paper.Published) -> dict[str, object]:
    return {
        "values": _named(found.values.tolist()),
        "sd_percent": _named(found.percent.tolist()),
        "sigma_W": found.sigma_W,
        "C": found.C,
    }


def _difference(places: Places) -> list[float] | None:
    found = essential_difference(places)
    return None if found is None else found.tolist()


def _named(values: list[float]) -> dict[str, float]:
    return dict(zip(PARAMETER_NAMES, values, strict=True))
