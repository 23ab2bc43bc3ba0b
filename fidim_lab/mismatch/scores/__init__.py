"""Score tests: what a fit of each hypothesis would gain, and how often that would be a false alarm.

In: a fitted model and the hypotheses. Out: scores, the most evident first (`views.view`).
"""
