"""Records, campaign and robot files, window files, time alignment. `load(DIR).to_frame()` is for notebooks."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fidim_lab.data.campaign_frame import LoadedCampaign


def load(folder: "Path | str") -> "LoadedCampaign":
    """Read a campaign or run folder; `.to_frame()` of it is a pandas table. Raises FileError naming file and line."""
    from fidim_lab.data.campaign_frame import load_campaign as read  # pandas only when it is needed

    return read(folder)
