"""Bytes, text, TOML, JSON and MCAP of files that somebody else may have written; every error names file and key."""
