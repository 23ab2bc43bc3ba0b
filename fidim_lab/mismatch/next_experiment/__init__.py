"""What to record next: the window that separates two explanations, or that sharpens the body most.

In: what was explained, and motions within reach. Out: a Proposal with the odds of each claim.
"""
