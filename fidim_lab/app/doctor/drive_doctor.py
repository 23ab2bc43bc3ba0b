"""What a drive can do, in a table for a person: from its dictionary alone, or from the drive that answers.

One line for each requirement with its grade, how this drive meets it and what takes its place; and every repair without
which its EDS file could not have been read.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path

from drivers.cia402.dictionary import GENERIC_EDS, DriveFamily, Graded, Load, Met, WinchConfig, family_path, read_family
from drivers.cia402.dictionary.family import GENERIC_FAMILY, families_of
from drivers.cia402.dictionary.fitted import by_file, speed_unit_by_file
from fidim_lab.app.doctor.checks import BY_TRIAL, Check, CheckVerdict
from fidim_lab.data.eds import EdsFile, Repair, read_dictionary


def check_eds(path: Path, family_name: str | None) -> list[Check]:
    """The grade table of a drive that nobody has asked yet. Raises FileError where EDS or family cannot be read.

    family_name: a built-in family, or a file (.toml); None is the generic one.
    """
    family = GENERIC_FAMILY if family_name is None else read_family(family_path(family_name, Path()))
    return check_dictionary(read_dictionary(path, 1), family)


def check_dictionary(found: EdsFile, family: DriveFamily) -> list[Check]:
    """The same of a file that was read."""
    config = WinchConfig(  # lengths and rated values do not matter: nothing is compared
        name=found.path.stem or "drive",
        node_id=1,
        counts_per_turn=1e4,
        drum_radius=0.03,
        rated_current=1.0,
        current_limit=1.0,
        max_speed=0.1,
        max_acceleration=1.0,
        length_limits=(0.5, 5.0),
        eds=found.path,
        family=family,
        load=Load.VENDOR if family.load_object else Load(family.load),
        rated_torque=1.0,
        torque_constant=1.0,
    )
    able, grades = by_file(found.dictionary, config)
    checks = [_described(found, family.name), *check_family(found, family), *check_repairs(found)]
    if able.without_axis:
        advice = "give the file of a drive: this one describes an I/O module, a master, an encoder or other axes alone"
        return [*checks, Check("drive", CheckVerdict.FAILED, able.without_axis, advice)]
    return checks + check_grades(grades, unproven=CheckVerdict.WARNING)


def _described(found: EdsFile, family: str) -> Check:
    known = ", ".join(filter(None, (found.vendor, found.product))) or "no maker named"
    return Check(f"EDS file {found.path.name}", CheckVerdict.OK, f"{known}: {len(found.dictionary)} objects; {family}")


def check_family(found: EdsFile, family: DriveFamily) -> list[Check]:
    """A warning where a drive's units may be others than those of its family.

    A maker's drive goes by the generic one, or the file's own 60A9 says otherwise.
    """
    name, unit = f"family of {found.path.name}", speed_unit_by_file(found.dictionary)
    known = families_of(found.vendor)
    if unit and "60A9:0" not in family.absent and not family.speaks(unit):
        fitting = [n for n in known if read_family(family_path(n, Path())).speaks(unit)]
        own = f'a family file of your own with speed = "{unit}" (docs/rig.md), or set 60A9 with the maker\'s tool'
        says = f"60A9 is {unit} by the file, and {' and '.join(family.speeds)} by {family.name}"
        return [Check(name, CheckVerdict.WARNING, says, f"family {', '.join(fitting)}" if fitting else own)]
    if family != GENERIC_FAMILY or unit or found.path == GENERIC_EDS or found.dictionary.get_variable(0x6040) is None:
        return []
    own = "look up the units of 6081, 606C and 6083: others than counts go into a family file of your own"
    advice = f"try family {', '.join(known)}" if known else own
    advice = f"{advice}: a drive with other units would move at another speed"
    return [Check(name, CheckVerdict.WARNING, f"{family.name}, for {found.vendor or 'a drive of no maker'}", advice)]


def check_repairs(found: EdsFile) -> list[Check]:
    """One line for each kind of repair, with every place."""
    places: dict[str, list[Repair]] = {}
    for repair in found.repairs:
        places.setdefault(repair.what, []).append(repair)
    advice = "nothing: it is repaired in memory; inform the maker"
    return [
        Check(f"EDS file {found.path.name}", CheckVerdict.WARNING, f"{what}: {_places(where)}", advice)
        for what, where in places.items()
    ]


def _places(repairs: Iterable[Repair]) -> str:
    lines: dict[str, list[int]] = {}
    for repair in repairs:
        lines.setdefault(repair.section, []).append(repair.line)
    words = [f"{f'[{section}] ' if section else ''}line {', '.join(map(str, at))}" for section, at in lines.items()]
    return "; ".join(words)


def check_grades(
    grades: Sequence[Graded], device: str = "", unproven: CheckVerdict = CheckVerdict.FAILED
) -> list[Check]:
    """The grade table. unproven: what it is that a stop is neither configured nor proven."""
    return [_grade(line, device, unproven) for line in grades]


def _grade(line: Graded, device: str, unproven: CheckVerdict) -> Check:
    requirement = line.requirement
    match line.met:
        case Met.CONFIGURED | Met.TRIAL:
            verdict, advice = CheckVerdict.OK, ""
        case Met.HOST:
            verdict, advice = CheckVerdict.WARNING, f"instead: {requirement.instead}"
        case Met.ABSENT if requirement.trials:
            verdict, advice = unproven, BY_TRIAL
        case Met.ABSENT:
            verdict, advice = (
                CheckVerdict.FAILED,
                f"no winch can be moved by this drive; {requirement.cure}",
            )
    return Check(requirement.key, verdict, f"{line.met}: {line.found}", advice, requirement.grade, device)
