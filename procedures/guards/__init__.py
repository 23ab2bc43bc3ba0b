"""What must never happen during a run, checked in every cycle: one file for each kind; `robot_guards` has the set."""
