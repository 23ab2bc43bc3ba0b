"""Which effects the model lacks: additions, one after the other, judged on held-out windows.

In: a Baseline, and how long the search may take (`mismatch.budget`). Out: a Selection: the best model and all that was
tried.
"""
