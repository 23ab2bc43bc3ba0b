"""Fits with hypotheses beside the body, on first seconds and on whole windows, and predictions of held-out windows.

In: a campaign (`baseline`), a fit and hypotheses (`refit`). Out: fitted models, their errors on held-out windows.
"""
