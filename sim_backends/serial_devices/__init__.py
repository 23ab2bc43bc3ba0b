"""Simulated devices on serial lines: pseudo terminals that are paced as a line of that baud rate would be."""
