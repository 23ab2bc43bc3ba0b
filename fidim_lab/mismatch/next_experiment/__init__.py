"""What to record next: windows that separate two explanations, or that determine the body better.

In: what was explained, and motions within reach. Out: a Proposal with the odds of each claim.
"""
