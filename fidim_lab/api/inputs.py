"""What the functions of the interface take: a robot, and a campaign of its recordings."""

from dataclasses import dataclass, fields
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from fidim_lab.data import records
from fidim_lab.data.campaign_frame import LoadedCampaign, load_campaign
from fidim_lab.data.robot_file import read_robot, robot_path, write_robot
from fidim_lab.errors import RefusedError
from fidim_lab.say import counted


@dataclass(frozen=True)
class Robot(records.Robot):
    """A robot as its file describes it (docs/own-robot.md): geometry in m, nominal body per unit mass, limits."""

    @staticmethod
    def read(path: Path | str) -> "Robot":
        """Read a robot file, or a built-in robot by its name ("irma4"). Raises FileError naming every wrong key."""
        found = read_robot(robot_path(str(path)))
        return Robot(**{field.name: getattr(found, field.name) for field in fields(found)})

    def write(self, path: Path | str) -> None:
        """Write a robot file that `read` reads back to the same values. Raises OSError."""
        write_robot(Path(path), self)

    def check(self) -> pd.DataFrame:
        """What `fidim doctor --robot` says: a row a check, with `ok`, `found` and `advice`."""
        from fidim_lab.app.doctor.robot_plausibility import plausibility

        return pd.DataFrame(plausibility(self)).rename(columns={"what": "check"}).set_index("check")

    def draw(self) -> str:
        """The robot at rest in the middle of its workspace, in letters. Raises RefusedError where it rests nowhere."""
        from fidim_lab.app.doctor.robot_plausibility import middle_rests
        from fidim_lab.app.doctor.robot_text import robot_views
        from fidim_lab.model.mechanism import Mechanism

        rests = middle_rests(Mechanism(self))
        if not rests:
            raise RefusedError("This robot rests nowhere under the middle of its anchors.", hint="See Robot.check().")
        return robot_views(self, rests[len(rests) // 2])

    def __repr__(self) -> str:
        return (
            f"Robot({counted(self.n, 'cable')}, {self.mass:g} kg, {counted(len(self.markers), 'marker')}, "
            f"{counted(self.freedoms, 'freedom')})"
        )


@dataclass(frozen=True, eq=False)
class Campaign(LoadedCampaign):
    """Windows of one robot's free motion. `windows` are frozen records of arrays: t in s, markers and lengths in m."""

    @staticmethod
    def read(folder: Path | str) -> "Campaign":
        """Read a campaign or run folder. Raises FileError naming file and line."""
        found = load_campaign(folder)
        return Campaign(**{field.name: getattr(found, field.name) for field in fields(found)})

    def plot(self, window: str | None = None) -> Figure:
        """The main marker's x, y, z over time, mm from the mean, of all windows or of one. Raises KeyError."""
        table = self.to_frame(window)
        figure = Figure(figsize=(8.0, 5.0), layout="constrained")
        for axis, name in zip(figure.subplots(3, 1, sharex=True), "xyz", strict=True):
            for id_, rows in table.groupby("window", sort=False):
                axis.plot(rows["t"], 1e3 * (rows[name] - rows[name].mean()), lw=0.7, label=id_)
            axis.set_ylabel(f"{name} / mm")
        figure.axes[-1].set_xlabel("t / s")
        figure.axes[0].legend(fontsize="x-small", ncols=8)
        return figure

    def __repr__(self) -> str:
        roles = [window.role.value for window in self.windows]
        counted = ", ".join(f"{roles.count(role)} {role}" for role in dict.fromkeys(roles))
        return f"Campaign({self.name!r}: {counted}; {self.sample_rate:g} Hz, {self.robot.n} cables)"
