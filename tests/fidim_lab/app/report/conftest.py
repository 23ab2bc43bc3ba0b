"""A recorded campaign, a journal and a result, small and made up, for reports."""

import json
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.campaign import write_campaign
from fidim_lab.data.records import PARAMETER_NAMES, Campaign, Motion, Role, Window
from fidim_lab.identification.equations.estimators import Method
from fidim_lab.identification.motion.trajectory import Prediction
from fidim_lab.identification.results.result import (
    IdentificationResult,
    InertialParameter,
    Residual,
    ResultOutcome,
    ShortAnswer,
    WindowVerdict,
)
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from procedures.outcomes import Outcome
from procedures.recording.journal import Journal, LineKind

TRUE = (0.0012, -0.0034, 0.1931, 0.0461, 0.0672, 0.0318, 0.0001, 0.0002, 0.0003)
"""what truth.json says"""


class Ticking:
    """A clock that counts on by a second each time it is read."""

    def __init__(self, start=100.0):
        self.t = start

    def now(self):
        self.t += 1.0
        return self.t

    async def sleep(self, seconds):
        raise AssertionError(seconds)


class JournalMaker:
    """Writes the lines that a run would."""

    def __init__(self, path, clock=None):
        self.path = path
        self.clock = clock or Ticking()

    def write(self, kind, **fields):
        with Journal(self.path, self.clock, lambda: "2000-01-01T00:00:00Z") as journal:
            journal.write(kind, sync=False, **fields)

    def begin(self, *windows):
        data = {"format": "fidim-journal/1", "windows": windows, "seconds": 60.0, "settings": {}}
        self.write(LineKind.RUN_STARTED, text="dry run", data=data)
        return self

    def start(self, step, window="i01"):
        self.write(LineKind.STEP_STARTED, step=step, window=window, text=step)
        return self

    def step(self, step, window="i01", outcome=Outcome.PASS, reason="", **data):
        self.start(step, window)
        self.write(LineKind.STEP_FINISHED, step=step, window=window, outcome=outcome, reason=reason, data=data)
        return self

    def attempt(self, window="i01", problem=""):
        outcome = Outcome.FAIL if problem else Outcome.PASS
        measured = {"name": "amplitude", "outcome": outcome.value, "value": 0.004, "unit": "m", "low": 0.005}
        self.step("AwaitHandsOff", window).step("Record", window)
        self.step("CheckWindow", window, outcome, problem, measurements=[measured])
        return self.step("Reject" if problem else "Accept", window, outcome, problem)

    def end(self, outcome=Outcome.PASS, reason="1 of 1 windows accepted."):
        self.write(LineKind.HELD, outcome=Outcome.PASS, reason="All winches stand still, held.")
        self.write(LineKind.RUN_FINISHED, outcome=outcome, reason=reason, data={"windows": {}, "seconds": 60.0})
        return self


@pytest.fixture(scope="session")
def ticking():
    """A clock class that starts where it is told."""
    return Ticking


@pytest.fixture(scope="session")
def journal_at():
    """Begin a journal at a path."""
    return JournalMaker


@pytest.fixture(scope="session")
def resting(irma4):
    """A pose of the paper's robot at rest, and its lengths."""
    return equilibrium_at(Mechanism(irma4), irma4.nominal, np.array([1.2, -0.2, -0.3]))


@pytest.fixture(scope="session")
def campaign(irma4, resting):
    """One window to identify from and one held out; 2 s each, currents, a gap."""
    t = np.arange(0, 2.0, 0.01)
    rng = np.random.default_rng(4)
    marker = resting.pose.position + 0.03 * np.cos(2 * np.pi * np.outer(t, [1.3, 1.7, 3.4]))
    marker[50:60] = np.nan
    window = Window(
        id="i01",
        role=Role.IDENTIFY,
        t=t,
        markers=marker[:, None] + 1e-4 * rng.normal(size=(len(t), 1, 3)),
        lengths=np.tile(resting.lengths, (len(t), 1)),
        currents=1.5 + 0.1 * rng.normal(size=(len(t), 4)),
        equilibrium=resting.pose.position,
    )
    return Campaign("made up", irma4, 100.0, (window, replace(window, id="v02", role=Role.VALIDATE)))


def verdict_on(window, **other):
    moved = np.nan_to_num(window.markers, nan=1.0) + 1e-3
    still, level = np.zeros((len(window.t), 6)), np.tile(np.eye(3), (len(window.t), 1, 1))
    prediction = Prediction(
        rms=1e-3, chi2_per_dof=3.25, residuals=window.markers - moved, t=window.t, markers=moved,
        motion=Motion(window.t, moved[:, 0], level, still, still),
    )  # fmt: skip
    epsilon = np.random.default_rng(1).normal(size=(len(window.t) - 20, 3))
    return replace(
        WindowVerdict(
            id=window.id, role=window.role, used=True, variant="surface", samples=180, sigma_perp=0.0871,
            rms_mm=1.732, chi2_per_dof=3.25, conditioning=1.44, residual=Residual(window.t[10:-10], 0.05 * epsilon),
            prediction=prediction,
        ),
        **other,
    )  # fmt: skip


@pytest.fixture(scope="session")
def result_of():
    """Make a result for a campaign."""

    def make(campaign, *, spread=3e-4, **other):
        values = (0.001, -0.0035, 0.1932, 0.0463, 0.067, 0.0319, 0.0, 0.0, 0.0)
        parameters = {
            name: InertialParameter(value, 1e-4, spread, spread, float(nominal))
            for name, value, nominal in zip(PARAMETER_NAMES, values, campaign.robot.nominal.vector, strict=True)
        }
        result = IdentificationResult(
            campaign=campaign.name, method=Method.TLS, outcome=ResultOutcome.CONVERGED, answer=ShortAnswer("Done."),
            parameters=parameters, non_essential=(), sigma_W=0.0613, C=9.0,
            windows=tuple(verdict_on(window) for window in campaign.windows), warnings=("mind the gap",), seconds=1.0,
            noise_ratio=1.07, covariance=1e-8 * np.eye(9), attachment_plane=0.2665,
        )  # fmt: skip
        return replace(result, **other)

    return make


@pytest.fixture(scope="session")
def write_folder(tmp_path_factory):
    """Write a campaign into a new folder, with a journal and truth where asked for."""

    def write(campaign, *, journal=False, truth=False):
        folder = tmp_path_factory.mktemp("run")
        write_campaign(folder, campaign)
        if truth:
            text = json.dumps(
                {"seed": 7, "case": {"label": ["air-drag-linear"]}, "s": TRUE[:3], "I": TRUE[3:], "m": 11}
            )
            (folder / "truth.json").write_text(text)
        if journal:
            lines = JournalMaker(folder / "journal.jsonl").begin("i01", "v02", "v03")
            lines.step("MoveTo").step("CheckTension", values=[61.0, 72.0, 55.0, 49.0])
            lines.attempt(problem="amplitude is 0.004 m").attempt().attempt("v02")
            (folder / "rejected").mkdir()
            (folder / "rejected" / "i01-attempt1.csv").write_text("t,x,y,z\n")
            lines.step("GiveUp", "v03", Outcome.SKIPPED, "skipped by the operator").end()
        return folder

    return write


@pytest.fixture
def undrawn(monkeypatch):
    """Pictures stay blank: for tests of the words, which need not wait for them."""
    drawn = ("drawings.figures", "drawings.scene", "drawings.spectra", "sections.proof_figures", "pages.compare_page")
    for module in drawn:
        monkeypatch.setattr(f"fidim_lab.app.report.{module}.to_svg", lambda figure: "<svg></svg>")
