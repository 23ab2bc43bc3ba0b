"""Physics that may have been left out: one file for each kind."""
