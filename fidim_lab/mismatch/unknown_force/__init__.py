"""Unknown physics, modelled as the best smooth wrench of position, velocity, rotation or time.

    model_unknown   a fitted model and held-out windows in, what the unknown force does out (`unknown`)
    families        what a wrench may depend on, and where it may act (`families`)
    responses       how windows answer to any wrench of the free directions, to first order (`responses`)
    weigh           which family explains how much, by evidence and by windows left out (`evidence`)

Thousands of basis functions cost next to nothing: every window's answer to bumps of force in time is computed once,
and any wrench along the fitted motion is a sum of such bumps.
"""
