"""What the paper printed (Idà, Briot & Carricato 2022): its optimised windows, results and deviations, to be compared.

Table 1 and Eq. 43 are the robot file `robots/irma4.toml`. Order of parameters: PARAMETER_NAMES.
"""

from dataclasses import dataclass

import numpy as np

from fidim_lab.data.records import Body

LENGTHS = np.array(
    [
        [1.66, 1.32, 1.30, 1.52, 1.11, 1.38, 1.19, 1.16, 1.46, 1.43, 1.35, 1.52],
        [1.86, 1.58, 1.26, 1.26, 1.68, 1.39, 1.15, 1.17, 1.16, 1.37, 1.45, 1.12],
        [1.68, 1.99, 1.57, 1.27, 2.19, 1.36, 1.65, 1.63, 1.24, 1.27, 1.42, 1.17],
        [1.41, 1.76, 1.56, 1.50, 1.72, 1.32, 1.65, 1.59, 1.50, 1.30, 1.28, 1.54],
    ]
).T
"""(12, 4) Table 2: optimised cable lengths, m"""

DISPLACEMENT_Y = 1e-3 * np.array([2.21, 7.11, 17.6, 14.4, 7.95, 16.6, 10.9, 9.70, 17.4, 1.51, 11.7, 99.7])
"""(12,) Table 3: optimised displacement along y, m"""
DISPLACEMENT_X_8 = 24.9e-3
"""Table 3 along x, m: k = 8, the only one that is legible in our copy"""

SIGMA_PERP_ABOVE = 1
"""of 22 windows in Fig. 3 with σ⊥ over σ_W (§5.2); the bars themselves are not printed as numbers"""
CROSS_VALIDATION_WINDOWS = 22
OPTIMUM_C = 5.94
"""C of the optimised windows, without noise (§5.1)"""


@dataclass(frozen=True, eq=False)
class Published:
    """One identification of the paper."""

    values: np.ndarray
    """(9,) m, m²"""
    percent: np.ndarray
    """(9,) σ%"""
    sigma_W: float
    C: float

    @property
    def body(self) -> Body:
        """The identified body."""
        return Body.from_vector(self.values)


FREE = Published(
    np.array([0.002, -0.0025, 0.1984, 0.0569, 0.0627, 0.0314, 2e-4, -2e-4, 1.6e-4]),
    np.array([4.32, 3.09, 0.15, 0.64, 0.31, 1.76, 80.5, 99.4, 136.0]),
    sigma_W=0.536,
    C=8.36,
)
"""Eq. 46: x and y of one marker, lengths held"""

FULL = Published(
    np.array([0.0016, -0.0025, 0.2, 0.0563, 0.0627, 0.0322, 4.8e-5, -2.5e-4, 3.4e-4]),
    np.array([2.43, 0.92, 0.05, 0.14, 0.16, 0.46, 107.0, 22.0, 23.0]),
    sigma_W=0.552,
    C=10.26,
)
"""Eq. 47: full pose from several markers (σ% of I_xz is printed as −22)"""

ESSENTIAL_DIFFERENCE = np.array([21.14, 0.01, 0.76, 1.11, 0.04, 2.77])
"""(6,) Eq. 49: |full − free| over |free|, %, of s_x, s_y, s_z, I_xx, I_yy, I_zz"""
