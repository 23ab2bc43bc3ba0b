"""What the importers share: cells, columns and labels of tables, MATLAB files, messages, poses of rigid bodies.

In: text and bytes of other programs. Out: numbers in SI, NaN where nothing was seen, or a FileError.
"""

from fidim_lab.data.importers.reading.cells import EPOCH, LENGTH_UNITS, MIN_FRAMES

__all__ = ["EPOCH", "LENGTH_UNITS", "MIN_FRAMES"]
