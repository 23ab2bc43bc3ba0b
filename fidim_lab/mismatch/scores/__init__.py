"""Score tests: the gain expected from fitting each hypothesis, and how often it would be a false alarm.

In: a fitted model and the hypotheses. Out: scores, the most evident first (`views.view`).
"""
