"""Devices on serial lines: release, load cells, inclinometers. Protocols are pure, `port` does the I/O."""
