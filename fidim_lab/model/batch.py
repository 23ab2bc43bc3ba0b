"""Calling compiled CasADi functions with numpy arrays, without copies and without Python loops over samples.

CasADi is column-major: an (N, k) array in C order is exactly its k × N matrix. So every quantity of one sample is one
column vector here, matrices flattened row by row (`rows`, `from_rows`), and nothing is transposed on the way.
"""

from collections.abc import Iterator, Sequence
from typing import Any
from weakref import WeakKeyDictionary

import casadi as ca
import numpy as np

from fidim_lab.errors import OurBugError
from fidim_lab.model.making import made_once

BLOCK = 64
"""samples that are computed by one map, a power of two: maps of 8 to 1000 are equally fast, and CasADi keeps the place
of every entry of a map's arguments and results, as much memory as these take themselves"""

_OVER_SAMPLES: WeakKeyDictionary[ca.Function, dict[int, ca.Function]] = WeakKeyDictionary()
"""functions of 1, 2, 4, … samples at once, kept as long as the one that they were made of"""


def rows(matrix: ca.SX) -> ca.SX:
    """The entries of a matrix row by row, as one dense column: numpy's C order."""
    return ca.densify(ca.vec(matrix.T))


def from_rows(column: ca.SX, height: int, width: int) -> ca.SX:
    """The inverse of `rows`: a height × width matrix from a column of its entries."""
    return ca.reshape(column, width, height).T


def function(name: str, inputs: Sequence[ca.SX], outputs: Sequence[ca.SX]) -> ca.Function:
    """A CasADi function of dense columns: what `evaluate` and `over_samples` can call."""
    return ca.Function(name, list(inputs), [ca.densify(output) for output in outputs])


def evaluate(compiled: ca.Function, *arguments: np.ndarray) -> list[np.ndarray]:
    """Call a function once through its memory buffers.

    Argument i has as many entries as the function's input i, column after column, hence shape (columns, rows) in
    C order. Returns one array of shape (columns, rows) for each output. NaN in, NaN out.

    Raises OurBugError where an argument has the wrong number of entries.
    """
    for index, argument in enumerate(arguments):
        _check(compiled, index, argument, compiled.numel_in(index))
    results = [np.empty((compiled.size2_out(k), compiled.size1_out(k))) for k in range(compiled.n_out())]
    _evaluate(compiled, arguments, results)
    return results


def over_samples(compiled: ca.Function, samples: int, *arguments: np.ndarray) -> list[np.ndarray]:
    """Evaluate a function of columns at N samples; a one-dimensional argument is the same for all samples.

    Arguments of shape (N, …), (…, k) with N columns in all, or (k,); results of shape (N, k).

    Raises OurBugError where an argument has the wrong number of entries.
    """
    columns: list[np.ndarray] = []
    for index, argument in enumerate(arguments):
        width, same = compiled.numel_in(index), argument.ndim == 1
        _check(compiled, index, argument, width if same else samples * width)
        shape = (samples, width)
        columns.append(np.broadcast_to(argument, shape) if same else argument.reshape(shape))
    results = [np.empty((samples, compiled.numel_out(k))) for k in range(compiled.n_out())]
    for some in blocks(samples):
        mapped = _mapped(compiled, some.stop - some.start)
        _evaluate(mapped, [column[some] for column in columns], [result[some] for result in results])
    return results


def _mapped(compiled: ca.Function, samples: int) -> ca.Function:
    return made_once(made_once(_OVER_SAMPLES, compiled, dict), samples, lambda: compiled.map(samples))


def blocks(samples: int) -> Iterator[slice]:
    """Consecutive blocks of 1, 2, 4, … `BLOCK` samples, few of them."""
    begin = 0
    while begin < samples:
        size = min(BLOCK, 1 << (samples - begin).bit_length() - 1)
        yield slice(begin, begin + size)
        begin += size


def _check(compiled: ca.Function, index: int, argument: np.ndarray, entries: int) -> None:
    if argument.size != entries:
        raise OurBugError(
            f"{compiled.name()}: argument {index} ({compiled.name_in(index)}) has {argument.size} entries, "
            f"not {entries}."
        )


def _evaluate(compiled: ca.Function, arguments: Sequence[np.ndarray], results: Sequence[np.ndarray]) -> None:
    """Into arrays in C order."""
    handle, run = _buffer(compiled)
    kept: list[np.ndarray] = []  # CasADi keeps only addresses
    for index, argument in enumerate(arguments):
        array = np.ascontiguousarray(argument, dtype=float)
        kept.append(array)
        if array.size:
            handle.set_arg(index, array.data)
    for index, result in enumerate(results):
        if result.size:
            handle.set_res(index, result.data)
    run()


def _buffer(compiled: ca.Function) -> tuple[Any, Any]:
    """CasADi's own signature of `buffer` and `set_arg` is wrong in its stubs."""
    made: Any = compiled.buffer()
    return made[0], made[1]
