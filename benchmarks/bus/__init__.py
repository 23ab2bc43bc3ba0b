"""What the drivers do on a bus, measured: `python -m benchmarks.bus rates | saturated | time | kills`."""
