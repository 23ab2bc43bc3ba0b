"""Swings made by winches instead of hands, measured: `python -m benchmarks.excite`, its parts in `__main__`."""
