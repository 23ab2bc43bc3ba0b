"""Maximum likelihood on whole trajectories (output error): the method `mle` (MODEL.md §3).

Residual: every recorded marker coordinate against the simulated free motion, whitened by the marker noise. Unknown:
the shared parameters (body, and θ of effects), and for each window its initial state; the cable lengths enter through
that state's prior, the encoder's resolution.

    fit            windows in, the optimum with its uncertainty out: start here
    identify       a campaign in, an IdentificationResult out: what `fidim identify` calls
    recordings     a window as this method needs it
    likelihood     residuals and their derivatives at a point (for score tests too)
    normal         the normal equations, each window compressed to a small triangular factor
    optimise       Levenberg–Marquardt at one horizon
    stages         the growing horizon: slipped phases and slack cables
    start          first guesses; possible: bodies that can move
    spread         covariance, bootstrap, jackknife, undetermined combinations
    judge          residuals of a window: χ²/dof, rms, whiteness, noise; held_out: windows the fit has not seen
"""
