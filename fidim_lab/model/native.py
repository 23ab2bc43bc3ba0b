"""Compiled C for CasADi functions, built once per machine and kept; the same digits about fifteen times faster.

Optional: without a C compiler CasADi's own virtual machine computes the same, and a warning is logged once per build.
Two ways to use it, both asked for by `Mechanism(robot, native=True)`:

    built(function)     waits for the compiler: where one function is called for the rest of the command
    Kernel.of(function) does not: the virtual machine computes until the library is there. For fits, which make a
                        kernel for each set of effects, most of them used for a second or two
"""

import hashlib
import logging
import os
import platform
import shutil
import subprocess
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from threading import Thread
from typing import Self

import casadi as ca

from fidim_lab.model.making import MAKING, made_once

FLAGS = ("-Og", "-ffp-contract=off", "-fPIC", "-shared")
"""no fused multiply-add: the digits of the virtual machine. Such straight-line code runs no faster with -O2, which
compiles for twice as long"""
HASTY = ("-O0", *FLAGS[1:])
"""for functions of tens of thousands of operations: an eighth of the compiler's time, a third of the speed"""
LARGE = 20_000
"""operations from which haste pays"""

PATIENCE = 120.0
"""s for one build"""

COMPILE = """out=$1; shift
mkdir -p -m 700 "$(dirname "$out")" && "$@" -x c - -o "$out.$$" && mv -f "$out.$$" "$out" && exit
status=$?; rm -f "$out.$$"; exit $status"""
"""of a shell: beside the destination and moved into place, so that two processes may build at once, and so that a build
ends well though the command that began it has ended"""

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
    kernel = Kernel.of(function)
    kernel.wait()
    return kernel.now()


@dataclass(eq=False)
class Kernel:
    """A function that is machine code as soon as its library is there; not frozen, for that moment changes it."""

    function: ca.Function
    """in CasADi's virtual machine; machine code once that could be loaded"""
    library: Path
    build: Thread | None
    """None: there is nothing to wait for"""
    _derived: dict[Hashable, ca.Function] = field(default_factory=dict[Hashable, ca.Function])

    @classmethod
    def of(cls, function: ca.Function, *, native: bool = True) -> Self:
        """From the cache, or with its build begun; without `native` the function as it is."""
        if not native:
            return cls(function, Path(), None)
        generator = ca.CodeGenerator(function.name())
        generator.add(function)
        source: str = generator.dump()
        flags = HASTY if function.n_instructions() > LARGE else FLAGS
        key = hashlib.sha256("\0".join([source, *flags, platform.platform(), version("casadi")]).encode()).hexdigest()
        library = cache_folder() / f"{function.name()}-{key[:24]}.so"
        if library.exists():
            return cls(_loaded(function, library), library, None)
        build = Thread(target=_build, args=(source, flags, library, function.name()), daemon=True)
        build.start()
        return cls(function, library, build)

    def now(self) -> ca.Function:
        """The fastest that there is at this moment; `class_name()` tells which."""
        build = self.build
        if build is not None and not build.is_alive():
            with MAKING:
                if self.build is build and self.library.exists():
                    self.function = _loaded(self.function, self.library)
                    self._derived.clear()
                self.build = None
        return self.function

    def derived(self, key: Hashable, make: Callable[[ca.Function], ca.Function]) -> ca.Function:
        """`make` of the fastest there is, made once for each key: CasADi takes its time for maps and loops."""
        self.now()
        return made_once(self._derived, key, lambda: make(self.function))

    def wait(self) -> None:
        """Until the build has ended, well or not."""
        if self.build is not None:
            self.build.join()


def _loaded(function: ca.Function, library: Path) -> ca.Function:
    try:
        return ca.external(function.name(), str(library))
    except RuntimeError as error:  # CasADi's own for a library that cannot be loaded
        _say_slow(function.name(), error)
        return function


def _build(source: str, flags: tuple[str, ...], library: Path, name: str) -> None:
    """Compile into the cache; says so where it cannot."""
    try:
        tool = compiler()
        if tool is None:
            raise FileNotFoundError("no C compiler (cc, gcc or clang) on the PATH")
        _log.info("compiling %s with %s, once for this model; kept in %s", name, Path(tool).name, library.parent)
        command = ["/bin/sh", "-c", COMPILE, "compile", str(library), tool, *flags]
        subprocess.run(command, input=source.encode(), check=True, capture_output=True, timeout=PATIENCE)
    except (OSError, subprocess.SubprocessError) as error:
        _say_slow(name, error)


def _say_slow(name: str, error: Exception) -> None:
    _log.warning("%s runs about 15 times slower, without compiled C: %s", name, error)
