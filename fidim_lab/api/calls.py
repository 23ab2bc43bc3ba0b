"""The functions of the interface. Each runs the workflow of the command of its name, with that command's defaults.

They take a `Robot` and a `Campaign` of its recordings, which are made here, too.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Literal

import pandas as pd
from matplotlib.figure import Figure

from fidim_lab.api.answers import Designed, Explained, Identified, Validated
from fidim_lab.api.as_command import as_command
from fidim_lab.app.analysis.validate import LIMIT, run_validate, sigma_of
from fidim_lab.app.formats.explanation_file import as_file
from fidim_lab.app.report.contents.found_model import read_found
from fidim_lab.app.workflows.identify import PosedCampaign, identify_posed, read_posed
from fidim_lab.data import records
from fidim_lab.data.campaign_frame import LoadedCampaign, load_campaign
from fidim_lab.data.robot_file import read_robot, robot_path, write_robot
from fidim_lab.errors import RefusedError, SetupError
from fidim_lab.identification.equations.estimators import Method
from fidim_lab.identification.motion.pose_sources import PoseSource
from fidim_lab.say import counted

AnyCampaign = records.Campaign | Path | str
"""a campaign in memory, or the folder of one"""


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


def load(folder: Path | str) -> Campaign:
    """Read a campaign or run folder. `.to_frame()` of it is a pandas table. Raises FileError naming file and line."""
    return Campaign.read(folder)


def load_robot(path: Path | str) -> Robot:
    """Read a robot file, or a built-in robot ("irma4"). Raises FileError naming every wrong key."""
    return Robot.read(path)


@as_command
def identify(
    campaign: AnyCampaign,
    method: str | None = None,
    *,
    paper: bool = False,
    pose_from: Literal["mocap", "swivel", "both"] = "mocap",
) -> Identified:
    """Find the platform's inertial parameters from recorded free motion.

    `method`: mle, tls, ls or iv; None takes what suits the campaign (mle, or tls where it cannot work, which is then
    said: `ok` is False). `paper`: total least squares to the paper's letter. `pose_from`: markers, the robot's own
    sensors, or both; the latter two take a folder. A misfit is told, and `ok` is False.
    Raises FileError for a wrong campaign, SetupError for an unknown method, RefusedError when no body is identified.
    """
    source = PoseSource(pose_from)
    if isinstance(campaign, records.Campaign):
        if source is not PoseSource.MOCAP:
            raise SetupError(f"pose_from={pose_from!r} takes the folder of a campaign, not one in memory.")
        posed = PosedCampaign(_with_windows(campaign))
    else:
        posed = read_posed(_folder(campaign), source)
    if paper and method not in (None, Method.TLS):
        raise SetupError(f"paper is a form of total least squares; it cannot be used with method {method!r}.")
    return Identified(identify_posed(posed, method, paper=paper))


@as_command
def explain(
    campaign: AnyCampaign,
    *,
    effort: float = 1.0,
    patience: float | None = None,
    without: str | Sequence[str] = (),
) -> Explained:
    """Name the physics that the model leaves out, and show it on held-out windows.

    `effort`: times the usual work after which the search ends and its best answer so far is given; `patience`: CPU
    seconds after which it does, too. `without`: effects of the catalogue to leave out of the search. Raises FileError
    for a wrong campaign, SetupError for an unknown effect or a limit below 0, RefusedError where no window can be
    fitted.
    """
    from fidim_lab.mismatch.explain import explain as search

    return Explained(search(_in_memory(campaign), effort=effort, patience=patience, without=_several(without)))


@as_command
def validate(
    campaign: AnyCampaign,
    parameters: Identified | Explained | Path | str,
    *,
    everything: bool = False,
    paper: bool = False,
    limit: float = LIMIT,
) -> Validated:
    """Do identified parameters predict the held-out windows of a campaign? Only initial states are fitted.

    `parameters`: an answer of `identify` or `explain` (with the effects that it names), or a file of one. `everything`:
    judge windows of role identify too. `limit`: largest χ²/dof. Raises FileError for a wrong file, SetupError without a
    window to judge, and for an explanation that names no physics.
    """
    match parameters:
        case Identified():
            given = parameters.result
        case Explained():
            given = as_file(parameters.explanation)
        case _:
            given = read_found(Path(parameters))
    how = {"everything": everything, "paper": paper}
    return Validated(run_validate(_in_memory(campaign), given, limit=limit, **how), sigma_of(given))


@as_command
def simulate(
    robot: Path | str,
    out: Path | str,
    *,
    hide: str | Sequence[str] = (),
    backend: Literal["native", "mujoco"] = "native",
    noise: float | None = None,
    seed: int = 1,
    equilibria: int = 12,
    validate: int = 6,
    plan: Path | str | None = None,
    own_sensors: bool = False,
) -> Campaign:
    """Write a campaign from the simulated world into the new folder `out`, with its truth beside it; returns it.

    `hide`: physics of that world, as "anchor-offset:cable=2,dx=0.006". `noise`: of a marker coordinate, m; None as the
    robot file says. `equilibria`, `validate`: windows to identify from, and held out. `plan`: windows to record
    instead. Raises SetupError for wrong options or a folder that holds files, FileError for a wrong robot file,
    InfeasibleError where the robot cannot swing as asked.
    """
    from fidim_lab.app.analysis.simulate import SimulateOptions, run_simulate

    options = SimulateOptions(
        robot=robot_path(str(robot)),
        out=Path(out),
        hide=_several(hide),
        backend=backend,
        noise=noise,
        seed=seed,
        equilibria=equilibria,
        validation=validate,
        plan=None if plan is None else Path(plan),
        own_sensors=own_sensors,
    )
    run_simulate(options)
    return load(out)


@as_command
def design(
    robot: Path | str = "irma4",
    *,
    equilibria: int = 12,
    samples: int = 100,
    starts: int = 8,
    criterion: Literal["C", "A", "D"] = "C",
    robust: int = 0,
    seed: int = 1,
    out: Path | str | None = None,
    processes: int | None = None,
) -> Designed:
    """Find the equilibria and displacements whose free motion tells most about the body.

    `criterion`: C as the paper (Eq. 40); A, D: mean and volume of the variances that mle will reach. `out`: folder for
    plan.toml, design.json and equilibria.svg. `processes`: local ones, None: one a core; 1 in a notebook.
    Raises FileError for a robot file that cannot be meant, SetupError for what cannot be designed, InfeasibleError
    where no design obeys the limits.
    """
    from fidim_lab.app.analysis.design import DesignOptions, run_design

    options = DesignOptions(
        robot=robot_path(str(robot)),
        equilibria=equilibria,
        samples=samples,
        starts=starts,
        criterion=criterion,
        robust=robust,
        seed=seed,
        out=None if out is None else Path(out),
        processes=processes,
    )
    return Designed(run_design(options))


def report(folder: Path | str, out: Path | str | None = None, *, pictures: Path | str | None = None) -> Path:
    """Write the HTML report of a run or campaign folder, one file that opens offline; returns its path.

    `out`: default FOLDER/report.html. `pictures`: a folder for all pictures as SVG files. Raises FileError where the
    folder cannot be read or the file not written.
    """
    from fidim_lab.app.report.pages.write import write_report

    return write_report(
        Path(folder), out=None if out is None else Path(out), pictures=None if pictures is None else Path(pictures)
    )


def _several(given: str | Sequence[str]) -> tuple[str, ...]:
    """A single one may be given as it is."""
    return (given,) if isinstance(given, str) else tuple(given)


def _in_memory(campaign: AnyCampaign) -> records.Campaign:
    return _with_windows(campaign) if isinstance(campaign, records.Campaign) else load(_folder(campaign))


def _with_windows(campaign: records.Campaign) -> records.Campaign:
    """Raises SetupError where a choice of windows has left none."""
    if not campaign.windows:
        raise SetupError(f"The campaign {campaign.name!r} holds no windows.", hint="Choose at least one of `windows`.")
    return campaign


def _folder(campaign: object) -> Path:
    """Raises SetupError for what is neither a campaign nor the path of one."""
    if isinstance(campaign, str | Path):
        return Path(campaign)
    what = f"{type(campaign).__name__} is not a campaign."
    raise SetupError(what, hint="Give what load or simulate returned, or the folder of a campaign.")
