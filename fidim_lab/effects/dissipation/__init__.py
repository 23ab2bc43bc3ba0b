"""Effects that take energy from the motion."""
