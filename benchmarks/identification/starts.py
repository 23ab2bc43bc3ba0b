"""From how far off does the fit find home? Random starts ±40 % off in every parameter.

A start that does not must be told by what `fidim identify` says: that it has not converged, that windows lost their
phase, or that χ²/dof shows something missing (the noise is as stated here, and the model is right).
"""

import argparse
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from benchmarks.identification.campaigns import Known, simulated
from benchmarks.page import write_section
from fidim_lab.data.records import Body, Role
from fidim_lab.errors import FidimError
from fidim_lab.identification.mle.fit import Fit, fit
from fidim_lab.identification.mle.judge import SURPRISE
from fidim_lab.model.mechanism import Mechanism

TITLE = "Starts ±40 % off"
SMALL = np.array([0.02, 0.02, 0.0, 0.0, 0.0, 0.0, 0.01, 0.01, 0.01])
"""m, m²: how far parameters that are nearly zero start off, where 40 % of them would be nothing"""
HOME = 0.05
"""sd: this near to the optimum reached from the truth is the same optimum"""


def ends_of(task: tuple[Known, list[int]]) -> list[tuple[int, float, str]]:
    """(draw, greatest distance from the optimum in sd, what gives it away) of random starts on one campaign."""
    known, draws = task
    mechanism, windows = Mechanism(known.campaign.robot, native=True), known.campaign.of_role(Role.IDENTIFY)
    home = fit(mechanism, windows, start=known.body)
    nominal = known.campaign.robot.nominal.vector
    ends: list[tuple[int, float, str]] = []
    for draw in draws:
        rng = np.random.default_rng([7, draw])
        start = nominal * (1 + rng.uniform(-0.4, 0.4, 9)) + SMALL * rng.uniform(-1, 1, 9)
        try:
            found = fit(mechanism, windows, start=Body.from_vector(start))
        except FidimError as refusal:
            ends.append((draw, np.inf, str(refusal)))
            continue
        distance = float(np.max(np.abs(found.values[:9] - home.values[:9]) / home.sd[:9]))
        ends.append((draw, distance, told(found)))
    return ends


def told(found: Fit) -> str:
    """What shows a user that this is not the optimum; empty where nothing does."""
    if not found.ending.settled:
        return found.ending.value
    if found.journey.lost:
        return "windows lose their phase"
    dof = sum(left.dof for left in found.remainders)
    return "χ²/dof" if (found.excess - 1) * np.sqrt(dof / 2) > SURPRISE else ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--starts", type=int, default=100)
    parser.add_argument("--campaigns", type=int, default=4)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    campaigns = [simulated(seed) for seed in range(1, options.campaigns + 1)]
    tasks = [(known, list(range(k, options.starts, len(campaigns)))) for k, known in enumerate(campaigns)]
    with ProcessPoolExecutor(options.workers) as pool:
        ends = [end for part in pool.map(ends_of, tasks) for end in part]
    home = sum(distance < HOME for _, distance, _ in ends)
    away = sorted(end for end in ends if end[1] >= HOME)
    text = (
        f"{home} of {options.starts} random starts (uniform ±40 % in every parameter of the robot file; s_x, s_y ± 20 "
        f"mm and products of inertia ± 0.01 m² off; {options.campaigns} campaigns) reach the optimum that is reached "
        f"from the truth, to {HOME} sd."
    )
    if away:
        cases = "; ".join(f"start {draw}: {distance:.2g} sd off, {why or 'untold'}" for draw, distance, why in away)
        text += (
            f" {sum(bool(why) for *_, why in away)} of the other {len(away)} are told by what identify says: {cases}."
        )
    print(text)
    command = f"python -m benchmarks.identification.starts --starts {options.starts}"
    write_section("identification", TITLE, command, text)


if __name__ == "__main__":
    main()
