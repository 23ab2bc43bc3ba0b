"""Pictures as inline SVG: one style, the same bytes for the same data.

In: numbers, windows, a robot. Out: Drawings with their captions; a Solid that a reader can turn.
"""
