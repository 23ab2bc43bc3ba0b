"""What is measured: each module is one run, `python -m benchmarks.…`; results go to docs/benchmarks."""
