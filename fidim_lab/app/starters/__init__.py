"""`fidim init`: new robot, rig, plan and campaign files with every key, its unit, its frame and how it is measured."""
