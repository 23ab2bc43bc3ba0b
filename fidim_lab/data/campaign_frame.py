"""A campaign for notebooks: `fidim_lab.data.load(DIR).to_frame()` gives one pandas table of all its windows."""

from dataclasses import dataclass, fields
from pathlib import Path

import pandas as pd

from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import Campaign, Window
from fidim_lab.data.window_csv import named


@dataclass(frozen=True, eq=False)
class LoadedCampaign(Campaign):
    """A `Campaign` that can also be had as a table."""

    folder: Path = Path()

    def to_frame(self, window: str | None = None) -> pd.DataFrame:
        """One row a sample, of all windows or of one; NaN for a missing sample. Raises KeyError for no such window.

        Columns: window, role, t (s from the window's begin), x y z and m2x … (m, world frame), l1 … (m), i1 … (A),
        then whatever further columns the window files have.
        """
        chosen = [known for known in self.windows if window in (None, known.id)]
        if not chosen and window is not None:
            raise KeyError(f"{window!r}; there are {', '.join(known.id for known in self.windows)}")
        return pd.concat([window_frame(known) for known in chosen], ignore_index=True)


def load_campaign(folder: Path | str) -> LoadedCampaign:
    """Read a campaign or run folder. Raises FileError (a `FidimError`) naming file and line."""
    campaign = read_campaign(Path(folder))
    values = {field.name: getattr(campaign, field.name) for field in fields(campaign)}
    return LoadedCampaign(**values, folder=Path(folder))


def window_frame(window: Window) -> pd.DataFrame:
    """One window as a table; see `LoadedCampaign.to_frame`."""
    names, values = named(window)
    table = pd.DataFrame(values, columns=names)
    table.insert(0, "role", window.role.value)
    table.insert(0, "window", window.id)
    return table
