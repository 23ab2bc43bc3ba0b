"""What a fit costs: compiled and not, its parts, and against the number of windows. CPU seconds, memory."""

import argparse
import resource
import subprocess
import sys
from dataclasses import replace
from time import perf_counter, process_time

import numpy as np

from benchmarks.identification.campaigns import papers_robot, simulated
from benchmarks.page import table, write_section
from fidim_lab.data.records import Role
from fidim_lab.identification.mle import held_out
from fidim_lab.identification.mle.fit import fit
from fidim_lab.identification.mle.trajectories.likelihood import linearised, simulate
from fidim_lab.identification.mle.trajectories.recordings import prepare
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.sensitivity.grid import FINE, QUICK

TITLE = "Time and memory"
MOST_WINDOWS = 192


def timed(action):
    wall, cpu = perf_counter(), process_time()
    result = action()
    return result, process_time() - cpu, perf_counter() - wall


def cost(windows: int, native: bool) -> None:
    """One fit of so many windows, printed as one line: CPU s, wall s, MiB, estimate."""
    known = simulated(1, 12)
    original = known.campaign.of_role(Role.IDENTIFY)
    many = [replace(original[k % 12], id=f"w{k}") for k in range(windows)]
    mechanism = Mechanism(papers_robot(), native=native)
    fit(mechanism, many[:2])  # builds expressions and kernels
    found, cpu, wall = timed(lambda: fit(mechanism, many))
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(repr((cpu, wall, memory, found.values[:9].tolist())))


def in_child(windows: int, native: bool) -> tuple[float, float, float, np.ndarray]:
    """In a process of its own, for its memory."""
    command = [sys.executable, "-m", "benchmarks.identification.speed", "--cost", str(windows)]
    done = subprocess.run(command + ([] if native else ["--vm"]), capture_output=True, text=True, check=True)
    cpu, wall, memory, values = eval(done.stdout.splitlines()[-1])
    return cpu, wall, memory, np.array(values)


def parts() -> list[list[object]]:
    known = simulated(1, 12, 6)
    rows = []
    mechanism = Mechanism(papers_robot(), native=True)
    found = fit(mechanism, known.campaign.of_role(Role.IDENTIFY))
    likelihood, point = found.likelihood, found.journey.optimum.point
    ends = np.array([10.0] * 12)
    rows.append(["12 motions of 10 s, states to 1e-8 m", *_row(lambda: simulate(likelihood, point, ends, FINE))])
    rows.append(["the same to 6e-8 m", *_row(lambda: simulate(likelihood, point, ends, QUICK))])
    simulation = simulate(likelihood, point, ends, FINE)
    rows.append(["their sensitivities", *_row(lambda: linearised(likelihood, simulation))])
    windows = [prepare(w, papers_robot()) for w in known.campaign.of_role(Role.VALIDATE)]
    sensors = papers_robot().sensors

    def hold_out():
        return [held_out.predict(mechanism, found.values, w, sensors) for w in windows]

    rows.append(["6 held-out windows", *_row(hold_out)])
    rows.append(["the whole fit", *_row(lambda: fit(mechanism, known.campaign.of_role(Role.IDENTIFY)))])
    return rows


def _row(action) -> list[str]:
    action()
    costs = [timed(action)[1:] for _ in range(3)]
    return [f"{min(cpu for cpu, _ in costs):.3f}", f"{min(wall for _, wall in costs):.3f}"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cost", type=int)
    parser.add_argument("--vm", action="store_true")
    options = parser.parse_args()
    if options.cost:
        cost(options.cost, not options.vm)
        return
    rows = []
    compiled = {windows: in_child(windows, True) for windows in (12, 48, MOST_WINDOWS)}
    for windows, (cpu, wall, memory, _) in compiled.items():
        ratio = cpu / compiled[12][0] / (windows / 12)
        rows.append([windows, "compiled", f"{cpu:.2f}", f"{wall:.2f}", f"{memory:.0f}", f"{ratio:.2f}"])
    cpu, wall, memory, values = in_child(12, False)
    rows.append([12, "virtual machine", f"{cpu:.2f}", f"{wall:.2f}", f"{memory:.0f}", ""])
    differ = np.max(np.abs(values - compiled[12][3]) / np.maximum(np.abs(values), 1e-4))
    head = ["windows", "kernel", "CPU s", "wall s", "MiB", "cost a window, relative"]
    text = f"""Fit from the robot file's body, 1001 samples a window.

{table(head, rows)}

Compiled and virtual machine differ by {differ:.1e} (relative). Parts of the compiled fit:

{table(["part", "CPU s", "wall s"], parts())}"""
    print(text)
    write_section("identification", TITLE, "python -m benchmarks.identification.speed", text)


if __name__ == "__main__":
    main()
