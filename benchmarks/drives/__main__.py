"""`python -m benchmarks.drives FOLDER`: every EDS, DCF, XDD and XDC file below a folder; the page of docs with --write.

Exit code 1 where a file is neither read nor refused with a cure, or a drive that is
not refused does not come to the end of its walk.
"""

import argparse
import sys
from pathlib import Path

from benchmarks.drives.count import by_maker, by_requirement, count, files_in, summary
from benchmarks.page import write_section


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.drives", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--write", action="store_true", help="write docs/benchmarks/drives.md")
    parser.add_argument("--each", action="store_true", help="a line for each file")
    options = parser.parse_args(arguments)
    paths = files_in(options.folder)
    if not paths:
        print(f"{options.folder}: no EDS, DCF, XDD or XDC file there", file=sys.stderr)
        return 2
    counted = [count(path) for path in paths]
    astray = [one for one in counted if one.walked is not None and not one.whole]
    for one in counted if options.each else [one for one in counted if one.refused or one in astray]:
        walked = one.walked
        ended = "" if walked is None else f"{walked.stage}{f': {walked.problem}' if walked.problem else ''}"
        print(f"{one.path.name}: {one.refused or ended or '; '.join(one.lacks) or 'no drive'}", file=sys.stderr)
    text = f"{summary(counted)}\n\n{by_maker(counted)}\n\n{by_requirement(counted)}"
    print(text)
    if options.write:
        write_section("drives", "Dictionaries of makers", "python -m benchmarks.drives FOLDER", text)
    return 1 if astray else 0


if __name__ == "__main__":
    sys.exit(main())
