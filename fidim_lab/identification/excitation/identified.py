"""The body from the windows recorded so far: for planning the next ones, not a result to report.

One window tells most of it, three all (to parts in a thousand): from then on strokes need no allowance for what CAD may
have wrong. What one leaves open are ways in which several parameters are off together, and which hardly change a swing:
bodies off in these ways are planned with, not each parameter by itself. Drag of the rotation is fitted beside the body,
since every real platform has some. What the recordings leave open, CAD says.
"""

import numpy as np

from fidim_lab.data.records import Body, Campaign
from fidim_lab.effects.dissipation.drag import RotationalDrag
from fidim_lab.errors import RefusedError
from fidim_lab.identification.excitation.bodies import OFF, Bodies, sizes
from fidim_lab.identification.mle.fit import fit
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.equations import BODY

LATEST = 4
"""windows that are looked at: few seconds, and enough"""
CAD = 2 * OFF
"""standard deviation of CAD, as a part: now and then it is off by more than strokes allow for"""
HONEST = 3.0
"""times the stated standard deviation, for the effects that a planning model leaves out"""
FINEST = 2e-3
"""part of each parameter's size that is never said to be known better"""
CERTAIN = 2.0
"""standard deviations by which an identified body may be off"""
MISFIT = 4.0
"""χ²/dof beyond which the body that fits is not believed: missing geometry or stiffness bends it by several times what
it is said to be off (three windows at 8 and more: 3 to 8 times)"""


def bodies_of(campaign: Campaign) -> Bodies:
    """What may hang there by the last windows and by CAD. Raises RefusedError where nothing can be learnt from them."""
    robot = campaign.robot
    found = fit(Mechanism(robot, (RotationalDrag(),)), campaign.windows[-LATEST:], hasty=True)
    if not found.chi2_per_dof < MISFIT:
        left = f"{found.chi2_per_dof:.1f}; at most {MISFIT:g} is accepted"
        raise RefusedError(f"The rigid model with drag leaves a χ²/dof of {left}.")
    size = sizes(robot.nominal)
    seen = HONEST**2 * max(1.0, found.chi2_per_dof) * found.covariance[:BODY, :BODY] + np.diag((FINEST * size) ** 2)
    # the mean of two normal distributions, written so that neither needs to be inverted
    cad = np.diag((CAD * size) ** 2)
    gain = np.linalg.solve((cad + seen).T, cad.T).T
    nominal = robot.nominal.vector
    values = nominal + gain @ (found.values[:BODY] - nominal)
    body = Body.from_vector(values)
    if not np.linalg.eigvalsh(body.inertia_about_com)[0] > 0:
        raise RefusedError("The body that fits best cannot exist.")
    left = (cad - gain @ cad) / np.outer(size, size)
    share, axes = np.linalg.eigh((left + left.T) / 2)
    most = np.minimum(CERTAIN * np.sqrt(np.maximum(share, 0.0)), OFF)
    return Bodies.within(body, (size[:, np.newaxis] * axes * most)[:, ::-1])
