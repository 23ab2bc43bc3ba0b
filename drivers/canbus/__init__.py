"""CAN frames and the buses that carry them."""
