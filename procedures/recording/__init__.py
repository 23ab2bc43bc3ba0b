"""The folder of a run: journal, windows, raw bytes, remaining work; written so that nothing is lost or spliced."""
