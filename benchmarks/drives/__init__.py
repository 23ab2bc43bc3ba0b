"""Every dictionary of a folder: read, repaired or refused, graded, and walked on a node simulated from it."""
