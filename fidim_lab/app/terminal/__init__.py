"""What commands share on a terminal: where output goes, progress, tables, workers of a computation."""
