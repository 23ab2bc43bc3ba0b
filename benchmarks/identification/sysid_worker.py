"""What `sysid_peer` runs in the environment of the peer: `mujoco.sysid` on windows prepared by it. No fidim-lab here.

The model is four tendons round swivelling pulleys, held by equalities. Unknown are the body (log-Cholesky, its mass
held) and for each window its start: pose and two rates of the free motion. What sysid lacks is given through its hooks:
start states, lengths' priors and the growing horizon. Columns that do not touch a window are not simulated again.
"""

import json
import sys
import time
from pathlib import Path

import mujoco
import numpy as np
from mujoco import rollout as mj_rollout
from mujoco import sysid
from mujoco.sysid._src import model_modifier
from scipy.spatial.transform import Rotation

HORIZONS = (0.3, 1.0, 3.0, 10.0)
MOST_ROUNDS = (12, 8, 6, 6)
NUDGE = 1e-6
OWN = 8


class Window:
    """One window and the model that stands at its guessed start."""

    def __init__(self, name, data):
        self.name = name
        self.t, self.seen, self.cables = data["t"], data["markers"], data["cables"]
        self.noise, self.resolution = data["noise"], data["resolution"]
        self.longer = data["longer"]
        self.spec = mujoco.MjSpec.from_string(data["xml"])
        self.spec.modelname = name
        self.model = self.spec.compile()
        self.data = mujoco.MjData(self.model)
        self.qpos = self.model.qpos0.copy()
        self.guessed = self.lengths(self.model, self.qpos)[: self.cables].copy()
        self.basis = self.free(self.model, self.qpos)
        wanted = np.concatenate(
            [data["twist"][:3], Rotation.from_matrix(data["rotation"]).inv().apply(data["twist"][3:])]
        )
        self.rates = np.linalg.lstsq(self.basis[:6], wanted, rcond=None)[0]

    def lengths(self, model, qpos):
        self.data.qpos[:] = qpos
        mujoco.mj_kinematics(model, self.data)
        mujoco.mj_comPos(model, self.data)
        mujoco.mj_tendon(model, self.data)
        return self.data.ten_length

    def free(self, model, qpos):
        """Velocities (nv, 2) that move no cable and leave swivels in their cables' planes."""
        rows = []
        for direction in np.eye(model.nv):
            ends = []
            for sign in (1.0, -1.0):
                there = qpos.copy()
                mujoco.mj_integratePos(model, there, direction, sign * NUDGE)
                ends.append(self.lengths(model, there).copy())
            rows.append((ends[0] - ends[1]) / (2 * NUDGE))
        by = np.array(rows).T
        n = self.cables
        held = np.vstack([by[:n], by[n::2] - by[n + 1 :: 2]])
        return np.linalg.svd(held)[2][-(model.nv - len(held)) :].T

    def start(self, model, own):
        """Full state at a start; the model's cables get the lengths that they have there."""
        qpos = self.qpos.copy()
        qpos[:3] += own[:3]
        turned = Rotation.from_rotvec(own[3:6]) * Rotation.from_quat(qpos[3:7], scalar_first=True)
        qpos[3:7] = turned.as_quat(scalar_first=True)
        for _ in range(3):  # swivels follow: left and right guide equally long
            ends = self.lengths(model, qpos).copy()
            for k in range(self.cables):
                there = qpos.copy()
                there[7 + k] += NUDGE
                moved = self.lengths(model, there)
                left, right = self.cables + 2 * k, self.cables + 2 * k + 1
                slope = (moved[left] - moved[right] - ends[left] + ends[right]) / NUDGE
                qpos[7 + k] -= (ends[left] - ends[right]) / slope
        here = self.lengths(model, qpos)[: self.cables].copy()
        model.eq_data[: self.cables, 0] = here - model.tendon_length0[: self.cables]
        free = self.free(model, qpos)
        qvel = free @ (free.T @ (self.basis @ own[6:8]))
        return np.concatenate([[0.0], qpos, qvel]), here - self.guessed


class Peer:
    def __init__(self, windows):
        self.windows = {window.name: window for window in windows}
        self.end, self.simulations, self.length_error, self.kept = 0.0, 0, {}, {}

    def build(self, params, spec):
        theta = np.concatenate([[self.alpha], params["body"].value])
        model_modifier.apply_body_theta_inertia(spec, "platform", theta)
        spec.body("platform").iquat = [1, 0, 0, 0]
        return spec.compile()

    def rollout(self, models, datas, initial_states, param_dicts, **ignored):
        window = self.windows[models[0].names.split(b"\0")[0].decode()]
        out = []
        for model, params in zip(models, param_dicts, strict=True):
            own = params[window.name].value
            key = (window.name, self.end, params["body"].value.tobytes(), own.tobytes())
            if key not in self.kept:
                self.kept[key] = self.simulated(window, model, datas[:1], own)
            out.append(self.kept[key])
        return out

    def simulated(self, window, model, datas, own):
        start, longer = window.start(model, own)
        steps = round(self.end / model.opt.timestep)
        state, _ = mj_rollout.rollout([model], datas, start[None], nstep=steps, skip_checks=False)
        self.simulations += 1
        every = round((window.t[1] - window.t[0]) / model.opt.timestep)
        state = np.vstack([start, state[0]])[::every].copy()
        series = sysid.TimeSeries(state[:, 0], state, {})
        found = sysid.SystemTrajectory(model, None, series, start, series)
        self.length_error[id(found.state.data)] = longer  # found is kept, so its id stays its own
        return found

    def residual(self, params, predicted, measured, model, *_, state=None, **ignored):
        window = self.windows[model.names.split(b"\0")[0].decode()]
        use = window.t <= self.end + 1e-9
        at = state[: use.sum()]
        R = Rotation.from_quat(at[:, 4:8], scalar_first=True).as_matrix()
        markers = at[:, 1:4] + R @ self.marker
        longer = self.length_error[id(state)]
        rows = [((markers - window.seen[use]) / window.noise).ravel(), (longer - window.longer) / window.resolution]
        return np.concatenate(rows), predicted, predicted


def main():
    given, out = Path(sys.argv[1]), Path(sys.argv[2])
    stored = np.load(given, allow_pickle=True)
    task = stored["task"].item()
    windows = [Window(f"w{k}", each) for k, each in enumerate(task["windows"])]
    peer = Peer(windows)
    peer.marker = task["marker"]
    begin, cpu = time.perf_counter(), time.process_time()
    model = windows[0].model
    mass = model.body("platform").mass[0]
    pi = np.concatenate([[mass], mass * task["com"], mass * task["inertia"].ravel()])
    theta = model_modifier.theta_from_pseudoinertia(model_modifier.pseudoinertia_from_pi(pi))
    peer.alpha = theta[0]
    params = sysid.ParameterDict()
    params.add(sysid.Parameter("body", theta[1:], theta[1:] - 3.0, theta[1:] + 3.0))
    wide = np.array([0.1, 0.1, 0.1, 0.5, 0.5, 0.5, 3.0, 3.0])
    for window in windows:
        own = np.concatenate([np.zeros(6), window.rates])
        params.add(sysid.Parameter(window.name, own, own - wide, own + wide))
    sequences = [sequence(window) for window in windows]
    for horizon, rounds in zip(HORIZONS, MOST_ROUNDS, strict=True):
        peer.end = min(horizon, float(windows[0].t[-1]))
        peer.kept, peer.length_error = {}, {}
        residual = sysid.build_residual_fn(
            models_sequences=sequences, build_model=peer.build, custom_rollout=peer.rollout,
            modify_residual=peer.residual, n_threads=1, resample_true=False,
        )  # fmt: skip
        params, result = sysid.optimize(
            params, residual, optimizer="mujoco", verbose=False, max_iters=rounds, eps=NUDGE, x_scale="jac", xtol=1e-6
        )
        rms = np.concatenate(residual(result.x.ravel(), params)[0])
        print(f"{peer.end:4.1f} s: {peer.simulations} simulations, {time.process_time() - cpu:.0f} s of CPU, "
              f"χ²/rows {np.mean(rms**2):.3f}", flush=True)  # fmt: skip
    left = residual(result.x.ravel(), params)[0]
    sigma, _ = sysid.calculate_intervals(left, result.jac)
    out.write_text(json.dumps(answer(peer, params, np.concatenate(left), sigma) | {
        "cpu": time.process_time() - cpu, "wall": time.perf_counter() - begin,
    }))  # fmt: skip


def answer(peer, params, left, sigma):
    def body(values):
        pi = np.asarray(model_modifier.pi_from_theta(np.concatenate([[peer.alpha], values])))
        return pi[1:] / pi[0]

    at = params["body"].value
    slopes = np.array([(body(at + d) - body(at - d)) / 2e-6 for d in 1e-6 * np.eye(9)]).T
    covariance = slopes @ np.asarray(sigma)[:9, :9] @ slopes.T
    return {
        "values": body(at).tolist(), "sd": np.sqrt(np.abs(np.diag(covariance))).tolist(),
        "chi2": float(np.mean(left**2)), "simulations": peer.simulations,
    }  # fmt: skip


def sequence(window):
    nothing = sysid.TimeSeries(window.t, np.zeros((len(window.t), 0)), {})
    seen = sysid.TimeSeries(window.t, np.zeros((len(window.t), 0)), {})
    state = np.concatenate([[0.0], window.qpos, np.zeros(window.model.nv)])
    return sysid.ModelSequences(window.name, window.spec, "window", state, nothing, seen, allow_missing_sensors=True)


if __name__ == "__main__":
    main()
