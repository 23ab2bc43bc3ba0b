"""From recorded windows to inertial parameters with their uncertainty."""
