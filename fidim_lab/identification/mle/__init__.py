"""Maximum likelihood on whole trajectories (output error): the method `mle` (spec/model.md §3).

Residual: every recorded marker coordinate against the simulated free motion, whitened by the marker noise. Unknown:
the shared parameters (body, and θ of effects), and for each window its initial state; the cable lengths enter through
that state's prior, the encoder's resolution.

    fit            windows in, the optimum with its uncertainty out: start here
    identify       a campaign in, an IdentificationResult out: what `fidim identify` calls
    trajectories   recordings against simulations: likelihood, normal equations, optimum over a growing horizon
    starts         first guesses
    spread         covariance, bootstrap, jackknife, undetermined combinations
    odd_windows    windows, and parts of them, that one body in free motion does not explain
    judge          residuals of a window: χ²/dof, rms, whiteness, noise; held_out: windows the fit has not seen
"""
