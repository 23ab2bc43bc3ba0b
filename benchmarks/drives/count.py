"""What becomes of each file of a folder, and of all of them by maker."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.drives.bench import Walked, walk, winch_config
from benchmarks.page import table
from drivers.cia402.dictionary import Graded, Met, read_family
from drivers.cia402.dictionary.family import FOLDER, families_of
from drivers.cia402.dictionary.fitted import by_file
from fidim_lab.data.eds import EdsFile, read_dictionary
from fidim_lab.errors import FileError

NODE = 5
_KINDS = (".eds", ".dcf", ".xdd", ".xdc")


@dataclass(frozen=True)
class Counted:
    """One file."""

    path: Path
    maker: str
    """as its VendorName has it, or who it is by its name"""
    refused: str = ""
    """section, line and cure; empty where it is read"""
    repairs: int = 0
    family: str = ""
    """with which it meets most; empty for what is no drive"""
    grades: tuple[Graded, ...] = ()
    walked: Walked | None = None
    """None: no drive, or refused"""

    def met(self, met: Met) -> list[str]:
        """Requirements that are met so."""
        return [line.requirement.key for line in self.grades if line.met is met]

    @property
    def lacks(self) -> list[str]:
        """What neither the drive nor a trial can give."""
        return [line.found for line in self.grades if line.met is Met.ABSENT and not line.requirement.trials]

    @property
    def whole(self) -> bool:
        """Whether the walk came to its end."""
        return self.walked is not None and self.walked.stage == "power off" and not self.walked.problem


def files_in(folder: Path) -> list[Path]:
    """EDS, DCF, XDD and XDC files, below it as well."""
    return sorted(path for path in folder.rglob("*") if path.suffix.lower() in _KINDS and path.is_file())


def count(path: Path) -> Counted:
    """Read, grade and walk one."""
    try:
        found = read_dictionary(path, NODE)
    except FileError as error:
        return Counted(path, path.stem, refused=f"{error.message} {error.hint}".replace(str(path), path.name))
    maker = found.vendor or "none named"
    if found.dictionary.get_variable(0x6040) is None:
        return Counted(path, maker, repairs=len(found.repairs))
    family, grades = _graded(found)
    config = winch_config(path, read_family(FOLDER / f"{family}.toml"))
    lacks = [line for line in grades if line.met is Met.ABSENT and not line.requirement.trials]
    walked = None if lacks else walk(config)
    return Counted(path, maker, "", len(found.repairs), family, grades, walked)


def _graded(found: EdsFile) -> tuple[str, tuple[Graded, ...]]:
    """The family of this maker with which the drive itself meets most, without any trial."""
    graded = {
        name: by_file(found.dictionary, winch_config(found.path, read_family(FOLDER / f"{name}.toml"), proofs=()))[1]
        for name in families_of(found.vendor) or ("generic",)
    }
    best = max(graded, key=lambda name: sum(line.met is Met.CONFIGURED for line in graded[name]))
    return best, graded[best]


def summary(counted: Sequence[Counted]) -> str:
    """One sentence for all of them."""
    drives = [one for one in counted if one.family]
    refused = [one for one in counted if one.refused]
    whole = [one for one in drives if one.whole]
    makers = {one.maker for one in whole}
    return (
        f"{len(counted)} files: {len(counted) - len(refused)} read, {sum(one.repairs > 0 for one in counted)} of them "
        f"repaired, {len(refused)} refused; {len(drives)} are drives, of which {len(whole)} walk from bring-up to "
        f"power-off ({len(makers)} makers) and {len(drives) - len(whole)} are refused before power."
    )


def by_maker(counted: Iterable[Counted]) -> str:
    """A table: how many files of each maker, and what its drives need."""
    makers: defaultdict[str, list[Counted]] = defaultdict(list)
    for one in counted:
        makers[one.maker].append(one)
    rows = [
        (
            maker,
            len(every),
            sum(one.repairs > 0 for one in every),
            sum(bool(one.family) for one in every),
            sum(one.whole for one in every),
            ", ".join(sorted({one.family for one in every if one.family})) or "no drive",
            _often(key for one in every if one.whole for key in one.met(Met.ABSENT)),
            _often(lack for one in every for lack in one.lacks),
        )
        for maker, every in sorted(makers.items(), key=lambda item: item[0].lower())
    ]
    head = ("maker", "files", "repaired", "drives", "walk", "family", "to be proven by trial (drives)", "refused for")
    return table(head, rows)


def by_requirement(counted: Iterable[Counted]) -> str:
    """A table: how the drives meet each requirement, by their dictionaries alone."""
    drives = [one for one in counted if one.family]
    met: defaultdict[str, Counter[Met]] = defaultdict(Counter)
    grades: dict[str, str] = {}
    for one in drives:
        for line in one.grades:
            met[line.requirement.key][line.met] += 1
            grades[line.requirement.key] = line.requirement.grade
    rows = [
        (key, grades[key], counts[Met.CONFIGURED], counts[Met.HOST], counts[Met.ABSENT]) for key, counts in met.items()
    ]
    return table(("requirement", "grade", "configured", "by the host", "needs a trial, or refused"), rows)


def _often(words: Iterable[str]) -> str:
    return "; ".join(f"{word} ({number})" for word, number in Counter(words).most_common()) or "–"
