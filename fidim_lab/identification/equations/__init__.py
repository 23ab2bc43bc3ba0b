"""The methods that solve equations of motion for the body: least squares, total least squares, instruments.

In: the windows of a campaign and a recipe (`problem`). Out: an Estimate with its uncertainty.
"""
