"""What comes before anything is fitted, the same for `identify` and `explain`."""
