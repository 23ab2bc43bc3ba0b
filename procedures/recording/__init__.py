"""The folder of a run: journal, windows, raw bytes, what is left to do; written so that nothing is lost or spliced."""
