"""`fidim init`: a new file of a kind, where nothing is yet."""

from dataclasses import dataclass
from pathlib import Path

from fidim_lab.app.formats.answer_file import write_answer
from fidim_lab.app.starters.plan import plan_text, write_campaign_folder
from fidim_lab.app.starters.rig import RigWish, rig_text
from fidim_lab.app.starters.robot import robot_text
from fidim_lab.app.terminal import console
from fidim_lab.data.robot_file import read_robot
from fidim_lab.errors import SetupError

FORMAT = "fidim-init/1"
ROBOT_FILE = Path("robot.toml")


@dataclass(frozen=True)
class InitOptions:
    """As on the command line."""

    kind: str
    """robot, rig, plan or campaign"""
    out: Path | None
    robot: Path | None
    cables: int
    simulated: bool
    json_file: Path | None


def init_command(options: InitOptions) -> int:
    """Write the file and say what to do next; returns 0.

    Raises SetupError where something is there already, FileError for a wrong robot file, InfeasibleError where that
    robot rests nowhere within its limits.
    """
    kind = options.kind
    path = options.out or Path("campaign" if kind == "campaign" else f"{kind}.toml")
    taken = path.exists() and not (kind == "campaign" and path.is_dir() and not any(path.iterdir()))
    if taken:
        raise SetupError(f"{path} exists already; nothing in it was touched.", hint="Choose another --out.")
    if kind == "robot":
        _check_cables(options.cables)
        text, further = robot_text(path, options.cables), f"fidim doctor --robot {path}"
    else:
        text, further = _for_robot(options, path)
    if text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    console.out.print(f"written     {path}", markup=False)
    console.out.print("            replace its numbers by yours; every key is explained in it", markup=False)
    console.out.print(f"next        {further}", markup=False)
    write_answer(options.json_file, FORMAT, {"kind": kind, "path": str(path), "next": further})
    return 0


def _check_cables(cables: int) -> None:
    """Raises SetupError for robots of which there is no pattern, with the reason."""
    if cables > 5:
        raise SetupError(
            f"--cables {cables}: with six cables or more and held motors a platform cannot swing. Allowed: 2 to 5."
        )
    if cables < 2:
        what = f"--cables {cables}: allowed are 2 to 5."
        raise SetupError(what, hint="A body on one cord: examples/robots and docs/pendulums.md.")


def _for_robot(options: InitOptions, path: Path) -> tuple[str, str]:
    """The text of a file that belongs to a robot, and what to type next; a campaign is written here."""
    robot_file = options.robot or ROBOT_FILE
    if options.robot is None and not ROBOT_FILE.exists():
        hint = "fidim init robot writes one; or name yours with --robot."
        raise SetupError(f"A {options.kind} is for a robot, and there is no {ROBOT_FILE} here.", hint=hint)
    robot = read_robot(robot_file)
    if options.kind == "rig":
        wish = RigWish(path, robot_file, robot, options.simulated)
        return rig_text(wish), f"fidim simulators {path}" if options.simulated else f"fidim doctor --rig {path}"
    if options.kind == "plan":
        return plan_text(path, robot_file, robot), f"fidim dry-run --robot {robot_file} --plan {path}"
    write_campaign_folder(path, robot_file, robot)
    return "", f"fidim identify {path}"
