"""Two or three faults at random, again and again: is the robot safe by the plant, and is what the run says true?

`python -m benchmarks.safety --runs 1000`, and `--run K` tells one run in full. `kinds` is the catalogue of faults,
`draw` combines them by seed, `one_run` carries a combination out, `judge` compares the run with the plant.
"""
