"""Physics that a model may leave out: one file for each kind, `catalogue` for all of them, `effect` for what each says.

docs/effects.md tells how to add one.
"""
