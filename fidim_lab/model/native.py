"""Compiled C for CasADi functions, built once per machine and kept; the same digits about fifteen times faster.

Optional: without a C compiler CasADi's own virtual machine computes the same, and a warning is logged once per build.
Worth its second or two of building for fits and designs, hence asked for by `Mechanism(robot, native=True)`.
"""

import hashlib
import logging
import os
import platform
import shutil
import subprocess
import tempfile
from importlib.metadata import version
from pathlib import Path

import casadi as ca

FLAGS = ("-O2", "-ffp-contract=off", "-fPIC", "-shared")
"""no fused multiply-add: the digits of the virtual machine"""

PATIENCE = 120.0
"""s for one build"""

_log = logging.getLogger(__name__)


def compiler() -> str | None:
    """Path of the C compiler that would be used, or None."""
    return next((found for name in ("cc", "gcc", "clang") if (found := shutil.which(name))), None)


def cache_folder() -> Path:
    """Where built kernels are kept: $XDG_CACHE_HOME/fidim-lab, else ~/.cache/fidim-lab."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "fidim-lab"


def built(function: ca.Function) -> ca.Function:
    """The same function as machine code, from the cache or built now; the function itself where that cannot be done.

    Without derivatives: build a function that returns them, and pass that one through here.
    """
    generator = ca.CodeGenerator(function.name())
    generator.add(function)
    source: str = generator.dump()
    key = hashlib.sha256("\0".join([source, *FLAGS, platform.platform(), version("casadi")]).encode()).hexdigest()
    library = cache_folder() / f"{function.name()}-{key[:24]}.so"
    try:
        if not library.exists():
            _build(source, library)
        return ca.external(function.name(), str(library))
    except (OSError, subprocess.SubprocessError, RuntimeError) as error:
        _log.warning("%s runs about 15 times slower, without compiled C: %s", function.name(), error)
        return function


def _build(source: str, library: Path) -> None:
    """Compile beside the destination and move into place, so that two processes may build at once."""
    tool = compiler()
    if tool is None:
        raise FileNotFoundError("no C compiler (cc, gcc or clang) on the PATH")
    library.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    # A warning, for it is to be seen on stderr without any set-up of logging: the command pauses here for seconds.
    what, by = library.stem.rsplit("-", 1)[0], Path(tool).name
    _log.warning("compiling %s with %s, once for this model (some seconds); kept in %s", what, by, library.parent)
    with tempfile.TemporaryDirectory(dir=library.parent) as folder:
        text, made = Path(folder) / "kernel.c", Path(folder) / "kernel.so"
        text.write_text(source, encoding="utf-8")
        subprocess.run([tool, *FLAGS, str(text), "-o", str(made)], check=True, capture_output=True, timeout=PATIENCE)
        made.replace(library)
