"""The residual of every window: whether it is white noise, when it breaks, and where it is large.

In: the residuals of a fit. Out: a judgement on whiteness, breaks of markers and encoders, places.
"""
