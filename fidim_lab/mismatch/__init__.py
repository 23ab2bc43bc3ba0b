"""Where simulation and recording differ, and why."""
