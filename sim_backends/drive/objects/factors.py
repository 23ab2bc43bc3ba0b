"""The factor group of a simulated drive: its shaft is counted as it is, so polarity, gear and feed say that."""

from sim_backends.drive.objects.dictionary import Dictionary

_RATIOS = (0x608F, 0x6091, 0x6092, 0x6093)


def counted_as_it_is(od: Dictionary) -> Dictionary:
    """The same dictionary; what an EDS file has as defaults would be another drive's mechanics."""
    od.fix(0x607E, 0, 0)
    for index in _RATIOS:
        for sub in (1, 2):
            od.fix(index, sub, 1)
    return od
