"""Free-motion experiments, identification and diagnosis of cable-suspended robots. Imports nothing on purpose."""
