"""Command line, composition, report: what a user meets."""
