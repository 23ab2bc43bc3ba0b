"""CANopen winches by the CiA 402 drive profile."""
