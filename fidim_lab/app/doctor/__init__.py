"""`fidim doctor`: checks of the installation, a robot file and a rig, without moving or writing anything."""
