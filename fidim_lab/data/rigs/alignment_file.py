"""How late motion capture is against the encoders: alignment.toml of a campaign, RIG.alignment.toml of a rig.

"fidim-alignment/1", written by the procedure `align`, readable for people. A campaign's lengths and currents are read
at the instants at which the cameras saw the markers beside them (`at_exposures`).
"""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tomli_w
from jaxtyping import Float
from pydantic import Field

from fidim_lab.arrays import Series
from fidim_lab.data.files.toml_file import Table, read_toml
from fidim_lab.data.files.whole_file import write_whole
from fidim_lab.data.records import Alignment

FORMAT = "fidim-alignment/1"
NAME = "alignment.toml"
"""in a campaign's folder"""


class _AlignmentTable(Table):
    format: Literal["fidim-alignment/1"]
    lag: Annotated[float, Field(ge=-1.0, le=1.0)]
    sd: Annotated[float, Field(gt=0)]
    correlation: Annotated[float, Field(ge=-1.0, le=1.0)]
    at: str
    source: str
    rate: Annotated[float, Field(gt=0)]
    sync_rate: Annotated[float, Field(gt=0)]


def alignment_path(rig: Path) -> Path:
    """Beside the rig file."""
    return rig.with_suffix(".alignment.toml")


def read_alignment(path: Path) -> Alignment | None:
    """None without a file. Raises FileError for one that is none."""
    if not path.exists():
        return None
    return Alignment(**read_toml(path, _AlignmentTable, FORMAT).model_dump(exclude={"format"}))


def write_alignment(path: Path, alignment: Alignment) -> Path:
    """Write what `read_alignment` reads, whole or not at all. Raises HardwareError where the disk does not take it."""
    head = "# Written by fidim (procedure align): markers show at t what encoders showed at t - lag (s).\n"
    return write_whole(path, head + tomli_w.dumps({"format": FORMAT, **vars(alignment)}))


def at_exposures(t: Series, values: Float[np.ndarray, "N k"], lag: float) -> Float[np.ndarray, "N k"]:
    """What stood in each row, as it was `lag` (s) before; NaN where either neighbour is missing.

    The first rows, before which nothing was recorded, keep the first value that there is.
    """
    wanted = np.clip(t - lag, t[0], t[-1])
    above = np.clip(np.searchsorted(t, wanted), 1, len(t) - 1)
    share = ((wanted - t[above - 1]) / (t[above] - t[above - 1]))[:, None]
    before, after = values[above - 1], values[above]
    mixed = (1.0 - share) * before + share * after
    return np.where(share == 0.0, before, np.where(share == 1.0, after, mixed))
