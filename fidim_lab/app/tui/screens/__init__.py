"""What each screen says: pure functions from a view and a width to lines; the same lines are what tests compare."""
