"""What must never happen while a run goes on, looked at in every cycle: one file a kind, `robot_guards` has the set."""
