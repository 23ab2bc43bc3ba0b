"""Commands of a lab session: run, resume, stop, reset, shutdown, dry runs, simulators, the UI."""
