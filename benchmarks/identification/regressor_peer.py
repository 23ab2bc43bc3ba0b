"""Our regressor W against pinocchio's body regressor, on random motion. Needs `pip install pin`, a peer."""

import argparse

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.page import write_section
from fidim_lab.data.records import Motion
from fidim_lab.model.regressor import platform_regressor

TITLE = "The regressor against pinocchio"
GRAVITY = np.array([0.0, 0.0, -9.81])
ORDER = (0, 1, 2, 3, 4, 6, 9, 5, 7, 8)
"""pinocchio: m, m c, then xx xy yy xz yz zz"""


def theirs(motion: Motion, k: int) -> np.ndarray:
    import pinocchio

    R = motion.rotations[k]
    v, omega = (R.T @ part for part in np.split(motion.twists[k], 2))
    a, alpha = (R.T @ part for part in np.split(motion.accelerations[k], 2))
    # a spatial acceleration is the classical one less ω × v; gravity enters as an acceleration of the frame
    spatial = pinocchio.Motion(np.concatenate([a - np.cross(omega, v) - R.T @ GRAVITY, alpha]))
    W = pinocchio.bodyRegressor(pinocchio.Motion(np.concatenate([v, omega])), spatial)
    return np.kron(np.eye(2), R) @ W[:, list(ORDER)]


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    rng, count = np.random.default_rng(1), 1000
    motion = Motion(
        np.arange(count, dtype=float),
        rng.normal(size=(count, 3)),
        Rotation.random(count, rng=rng).as_matrix(),
        rng.normal(size=(count, 6)),
        rng.normal(size=(count, 6)) * 5,
    )
    ours = platform_regressor(motion, GRAVITY)
    apart = max(float(np.abs(ours[k] - theirs(motion, k)).max()) for k in range(count))
    text = f"{count} random poses, twists and accelerations: the largest difference of any entry of W is {apart:.1e}."
    print(text)
    write_section("identification", TITLE, "python -m benchmarks.identification.regressor_peer", text)


if __name__ == "__main__":
    main()
