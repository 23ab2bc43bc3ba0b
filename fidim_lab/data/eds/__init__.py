"""EDS, DCF, XDD and XDC files of drives, as their makers ship them: `read_dictionary`, which repairs what it must.

`text.py` takes a file apart into sections, keys and lines, `xdd.py` one that is XML; `numbers.py` reads numbers in
every spelling; `objects.py` makes one clean description of each object, and says what it repaired; `reader.py` gives
that to the `canopen` library.
"""

from fidim_lab.data.eds.reader import EdsFile, read_dictionary
from fidim_lab.data.eds.text import Repair

__all__ = ["EdsFile", "Repair", "read_dictionary"]
