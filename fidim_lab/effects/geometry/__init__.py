"""Effects of a geometry or a clock that is not as the robot file says."""
