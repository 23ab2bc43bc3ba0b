"""The prediction of a recording, made by the worker from what a recording of a known body has shown so far."""

import asyncio
from dataclasses import replace

import numpy as np
import pytest

from drivers.clock import LoopClock
from fidim_lab.app.tui.foresee import Seer
from fidim_lab.app.tui.foresight import Foresight
from fidim_lab.app.tui.view import Trace
from fidim_lab.data.plan_file import write_plan
from fidim_lab.data.records import Body, Plan, PlannedWindow, Role
from fidim_lab.data.robot_file import write_robot
from fidim_lab.model.equilibria import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import consistent_twist, simulate_free_motion

SEEN, WHOLE = 2.5, 6.0
"""s"""
LENGTHS = np.array([1.30283, 1.39119, 1.52772, 1.41231])


@pytest.fixture(scope="module")
def path(irma4):
    """(N,) s and (N, 3) m of the main marker: the nominal body, swinging."""
    mechanism = Mechanism(irma4)
    rest = pose_from_lengths(mechanism, irma4.nominal, LENGTHS).pose
    twist = consistent_twist(mechanism, irma4.nominal, rest, np.array([0.3, 0.3, 0.0, 0.0, 0.0, 0.0]))
    times = np.arange(0.0, WHOLE, 0.01)
    motion = simulate_free_motion(mechanism, irma4.nominal, rest, twist, times).motion
    return times, motion.positions + np.einsum("nij,j->ni", motion.rotations, irma4.marker)


@pytest.fixture
def trace(path):
    times, marker = path
    seen = times <= SEEN
    noise = np.random.default_rng(1).normal(scale=1e-4, size=marker.shape)
    positions = [tuple(map(float, row)) for row in (marker + noise)[seen]]
    positions[20] = None  # an occlusion
    return Trace("i01", 1, [100.0 + float(t) for t in times[seen]], positions, [tuple(LENGTHS)] * int(seen.sum()))


def _error(path, found_t, found_positions):
    """Largest distance from the true path over what had not been seen yet, m."""
    times, marker = path
    ahead = times > SEEN
    model = np.stack([np.interp(100.0 + times[ahead], found_t, np.array(found_positions)[:, k]) for k in range(3)], 1)
    return float(np.linalg.norm(model - marker[ahead], axis=1).max()), float(np.ptp(marker[ahead], axis=0).max())


def test_what_has_not_happened_yet_is_foretold(irma4, path, trace, tmp_path):
    write_robot(tmp_path / "robot.toml", irma4)
    found = Seer().answer(
        {"folder": str(tmp_path), "window": "i01", "t": trace.t, "positions": trace.positions, "lengths": trace.lengths}
    )
    assert found["body"] == "CAD"
    error, motion = _error(path, found["t"], found["positions"])
    assert motion > 0.01
    assert error < 0.05 * motion


def test_a_recording_that_no_model_follows_gets_a_reason(irma4, trace, tmp_path):
    write_robot(tmp_path / "robot.toml", irma4)
    wrong = [(0.1 * k % 0.3, 0.0, 0.0) for k in range(len(trace.t))]
    found = Seer().answer(
        {"folder": str(tmp_path), "window": "i01", "t": trace.t, "positions": wrong, "lengths": trace.lengths}
    )
    assert found.keys() == {"doubt"}
    assert found["doubt"]


@pytest.mark.slow
def test_a_body_that_is_not_quite_right_still_gives_a_prediction_whose_error_grows(irma4, path, tmp_path):
    write_robot(tmp_path / "robot.toml", replace(irma4, nominal=Body.from_vector(1.15 * irma4.nominal.vector)))
    times, marker = path
    found = Seer().answer(
        {
            "folder": str(tmp_path),
            "window": "i01",
            "t": [100.0 + float(t) for t in times],
            "positions": marker.tolist(),
            "lengths": [tuple(LENGTHS)] * len(times),
        }
    )
    error, motion = _error(path, found["t"], found["positions"])
    assert found["fitted"] <= 4.0
    assert error > 0.1 * motion


def test_a_folder_without_robot_file_gets_a_reason(trace, tmp_path):
    found = Seer().answer({"folder": str(tmp_path), "window": "i01", "t": [0.0], "positions": [None], "lengths": [[]]})
    assert "robot.toml" in found["doubt"]


def test_what_costs_time_is_made_before_there_is_a_recording(irma4, tmp_path):
    write_robot(tmp_path / "robot.toml", irma4)
    seer = Seer()
    assert seer.answer({"folder": str(tmp_path)}) == {"ready": False}  # no plan: nothing to rehearse with
    window = PlannedWindow("i01", Role.IDENTIFY, LENGTHS, np.array([0.02, 0.03]), np.array([1.1, -0.27, -0.31]))
    write_plan(tmp_path / "plan.toml", Plan("one", (window,)))
    assert seer.answer({"folder": str(tmp_path)}) == {"ready": True}


@pytest.mark.slow
def test_the_worker_is_asked_when_there_is_enough_to_fit(irma4, path, trace, tmp_path):
    write_robot(tmp_path / "robot.toml", irma4)

    async def look() -> list[float]:
        foresight, clock, fitted = Foresight(), LoopClock(), []
        growing = Trace("i01", 1, trace.t[:120], trace.positions[:120], trace.lengths[:120])
        try:
            for rows, wanted in ((120, 0), (250, 1)):
                growing.t[:], growing.positions[:] = trace.t[:rows], trace.positions[:rows]
                growing.lengths[:] = trace.lengths[:rows]
                for _ in range(1200 if wanted else 5):
                    foresight.look(growing, tmp_path)
                    if foresight.found is not None:
                        break
                    await clock.sleep(0.05)
                fitted.append(0.0 if foresight.found is None else foresight.found.fitted)
        finally:
            await foresight.close()
        return fitted

    nothing_yet, then = asyncio.run(look())
    assert nothing_yet == 0.0
    assert then == pytest.approx(2.49, abs=0.6)
