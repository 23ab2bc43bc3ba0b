"""Calling compiled CasADi functions with numpy arrays, without copies and without Python loops over samples.

CasADi is column-major: an (N, k) array in C order is exactly its k × N matrix. So every quantity of one sample is one
column vector here, matrices flattened row by row (`rows`, `from_rows`), and nothing is transposed on the way.
"""

from collections.abc import Sequence
from typing import Any
from weakref import WeakKeyDictionary

import casadi as ca
import numpy as np

from fidim_lab.errors import OurBugError

_OVER_SAMPLES: WeakKeyDictionary[ca.Function, dict[int, ca.Function]] = WeakKeyDictionary()
"""functions of so many samples at once, kept as long as the one that they were made of: half of the time of a call"""


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
    handle, run = _buffer(compiled)
    kept: list[np.ndarray] = []  # CasADi keeps only addresses
    for index, argument in enumerate(arguments):
        array = np.ascontiguousarray(argument, dtype=float)
        if array.size != compiled.numel_in(index):
            raise OurBugError(
                f"{compiled.name()}: argument {index} ({compiled.name_in(index)}) has {array.size} entries, "
                f"not {compiled.numel_in(index)}."
            )
        kept.append(array)
        if array.size:
            handle.set_arg(index, array.data)
    results: list[np.ndarray] = []
    for index in range(compiled.n_out()):
        result = np.empty((compiled.size2_out(index), compiled.size1_out(index)))
        results.append(result)
        if result.size:
            handle.set_res(index, result.data)
    run()
    return results


def over_samples(compiled: ca.Function, samples: int, *arguments: np.ndarray) -> list[np.ndarray]:
    """Evaluate a function of columns at N samples in one call; a one-dimensional argument is the same for all samples.

    Arguments of shape (N, …) or (k,); results of shape (N, k).
    """
    columns = [
        np.broadcast_to(argument, (samples, argument.size)) if argument.ndim == 1 else argument
        for argument in arguments
    ]
    made = _OVER_SAMPLES.setdefault(compiled, {})
    if samples not in made:
        made[samples] = compiled.map(samples)
    return evaluate(made[samples], *columns)


def _buffer(compiled: ca.Function) -> tuple[Any, Any]:
    """CasADi's own signature of `buffer` and `set_arg` is wrong in its stubs."""
    made: Any = compiled.buffer()
    return made[0], made[1]
