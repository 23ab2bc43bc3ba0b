"""Commands on what was recorded: import, export, verify, replay, compare."""
