"""From recorded samples to the platform's motion: grids, filters, poses, twists and accelerations.

In: a window, or poses over time. Out: a MeasuredMotion; a predicted trajectory; hand-free windows.
"""
