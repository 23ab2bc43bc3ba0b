"""Which effects are left out: additions to a model, one after the other, judged on held-out windows.

In: a Baseline, and how long the search may take (`budget`). Out: a Selection: the best model and all that was tried.
"""
