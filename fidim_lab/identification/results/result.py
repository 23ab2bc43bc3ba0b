"""The result of `identify`: frozen, with an outcome and an answer in words."""

from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np
from jaxtyping import Float

from fidim_lab.arrays import Series
from fidim_lab.data.files.json_file import as_json
from fidim_lab.data.files.mistakes import STRICT
from fidim_lab.data.records import PARAMETER_NAMES, Body, Role
from fidim_lab.identification.cleaning.removed import Removed
from fidim_lab.identification.equations.estimators import Method
from fidim_lab.identification.equations.refusals import no_sigma
from fidim_lab.identification.equations.uncertainty import jackknife_sd
from fidim_lab.identification.motion.trajectory import Prediction


class ResultOutcome(Enum):
    """How it ended. `code` goes into files; the value is for people."""

    CONVERGED = "The inertial parameters are identified."
    MISFIT = (
        "The best fit was found, but the model does not explain the recordings: the parameters are wrong by an "
        "unknown amount."
    )
    LOST_PHASE = (
        "The simulated motion could not follow most of the recordings to their end: the model is wrong, and so are the "
        "parameters."
    )
    NOT_CONVERGED = "The fit was ended before it had converged; the parameters are not the best ones."
    DOUBTFUL = "Partly identified: some important parameters are not determined, or known to no better than 10 %."
    UNSEEN = "The model explains the recordings, but these do not determine any of the nine parameters separately."
    IMPOSSIBLE_BODY = "Parameters were found, but no body can have them; do not use them."

    def __str__(self) -> str:
        """The sentence, as a script prints it."""
        return self.value

    @property
    def good(self) -> bool:
        """Whether the parameters may be used."""
        return self is ResultOutcome.CONVERGED

    @property
    def answers(self) -> bool:
        """Whether this is an answer to what was asked, if only of a part (exit code 0); else a refusal or failure."""
        return self in (ResultOutcome.CONVERGED, ResultOutcome.DOUBTFUL)

    @property
    def code(self) -> str:
        """As result files have it ("fidim-result/1")."""
        return _CODES[self]

    @property
    def next(self) -> str:
        """What to do about it, as a sentence."""
        if self is ResultOutcome.CONVERGED:
            return "Nothing more is needed."
        if self in (ResultOutcome.DOUBTFUL, ResultOutcome.UNSEEN):
            return "Record more windows, at other equilibria and with larger swings."
        return "Run fidim explain to find what is missing."


@dataclass(frozen=True)
class ShortAnswer:
    """An answer in four short parts, for people; a part may be empty."""

    verdict: str
    certain: str = ""
    not_known: str = ""
    next: str = ""

    @property
    def parts(self) -> tuple[tuple[str, str], ...]:
        """Those that say something, with their titles."""
        titles = ("Verdict", "Certain", "Not known", "Next")
        said = (self.verdict, self.certain, self.not_known, self.next)
        return tuple((title, part) for title, part in zip(titles, said, strict=True) if part)

    @property
    def message(self) -> str:
        """What was found, as one paragraph."""
        return " ".join(filter(None, (self.verdict, self.certain, self.not_known)))


_CODES = {
    ResultOutcome.CONVERGED: "converged",
    ResultOutcome.MISFIT: "misfit",
    ResultOutcome.LOST_PHASE: "not-converged",
    ResultOutcome.NOT_CONVERGED: "not-converged",
    ResultOutcome.DOUBTFUL: "partial",
    ResultOutcome.UNSEEN: "partial",
    ResultOutcome.IMPOSSIBLE_BODY: "impossible",
}

MOVED_BY = {
    "I_xx": ("s_y", "s_z"),
    "I_yy": ("s_x", "s_z"),
    "I_zz": ("s_x", "s_y"),
    "I_xy": ("s_x", "s_y"),
    "I_xz": ("s_x", "s_z"),
    "I_yz": ("s_y", "s_z"),
}
"""what takes a moment from P to G (parallel-axis theorem)"""


@dataclass(frozen=True)
class Estimated:
    """A value with its standard deviation, SI."""

    __pydantic_config__ = STRICT  # pyright: ignore[reportUnannotatedClassAttribute]

    value: float
    sd: float


@dataclass(frozen=True)
class InertialParameter:
    """One inertial parameter (m or m², per unit mass, about P)."""

    value: float
    sd: float
    """the ± to believe: with the survey of the geometry in it and, where the model misses more than noise, the spread
    between windows; of methods that work on equations nominal (Eq. 33)"""
    sd_bootstrap: float | None
    """block bootstrap over windows"""
    sd_jackknife: float | None
    """delete one window"""
    nominal: float
    """what the robot file (CAD) says"""
    without_non_essential: float | None = None
    """value of the re-fit without the non-essential parameters, where there is one"""
    seen: bool = True
    """whether the recordings say anything of it; where not, the value is only one that a body can have"""

    @property
    def spread(self) -> float | None:
        """The larger of the two spreads between windows; None with fewer than three windows."""
        known = [sd for sd in (self.sd_bootstrap, self.sd_jackknife) if sd is not None]
        return max(known) if known else None


@dataclass(frozen=True)
class Moved:
    """One piece of the geometry where the recordings have it, against the robot file."""

    __pydantic_config__ = STRICT  # pyright: ignore[reportUnannotatedClassAttribute]

    what: str
    """by the key of the robot file's `[survey]`"""
    cable: int | None
    """1-based"""
    by: tuple[float, ...]
    """m or rad"""
    sd: tuple[float, ...]


@dataclass(frozen=True)
class AnchorByEncoder:
    """What the encoder of one cable says of its anchor, its zero unknown: independent information that no fit uses."""

    __pydantic_config__ = STRICT  # pyright: ignore[reportUnannotatedClassAttribute]

    cable: int
    """1-based"""
    windows: int
    """in which it was read"""
    scatter: float
    """m, standard deviation of its zero over the windows with the robot file's geometry"""
    left: float
    """m, the same with the anchor moved"""
    by: tuple[float, float, float]
    """m, world frame: how far the anchor is moved then"""
    sd: tuple[float, float, float]
    log_odds: float
    """nats for an anchor as far off as this asks for, over the file's"""


@dataclass(frozen=True)
class Geometry:
    """What the recordings say of the robot file's geometry."""

    chi2_gain: float
    """by how much the sum of squares falls when the geometry is left open, in units of χ²/dof"""
    moved: tuple[Moved, ...] = ()
    """everything that was left open; nothing where the file's geometry counts as exact"""
    stated: bool = False
    """whether the robot file states a survey"""
    encoders: tuple[AnchorByEncoder, ...] = ()
    """of each cable, where encoders with unknown zeros were read in several windows"""

    @property
    def pieces(self) -> dict[tuple[str, int | None], tuple[float, ...]]:
        """By key and cable, as `survey.as_found` asks for them."""
        return {(one.what, one.cable): one.by for one in self.moved}

    @property
    def table(self) -> dict[str, Any]:
        """As spec/formats.md has it."""
        encoders = {"encoders": as_json(self.encoders)} if self.encoders else {}
        return {"chi2_gain": self.chi2_gain, "moved": as_json(self.moved), **encoders}


@dataclass(frozen=True, eq=False)
class Residual:
    """ε = W χ of one window over time."""

    t: Series
    """s"""
    epsilon: np.ndarray
    """(N, K); m/s² with the default rows"""


@dataclass(frozen=True, eq=False)
class WindowVerdict:
    """What the result means for one window."""

    id: str
    role: Role
    used: bool
    variant: str | None = None
    """how its motion was measured; None where it was not used"""
    samples: int = 0
    """usable samples"""
    sigma_perp: float | None = None
    """σ⊥ (Eq. 50), m/s² with the default rows"""
    rms_mm: float | None = None
    """of the trajectory predicted from its fitted initial state; None where that failed or was not asked for"""
    chi2_per_dof: float | None = None
    conditioning: float | None = None
    """worst of the free coordinates used"""
    notes: tuple[str, ...] = ()
    residual: Residual | None = None
    prediction: Prediction | None = None
    no_sigma: str = ""
    """why there is no σ⊥, where the window is used without one"""


@dataclass(frozen=True, eq=False)
class IdentificationResult:
    """The identified body with everything needed to judge it."""

    campaign: str
    method: Method
    outcome: ResultOutcome
    answer: ShortAnswer
    parameters: dict[str, InertialParameter]
    """in the order of PARAMETER_NAMES, all nine estimated together"""
    non_essential: tuple[str, ...]
    sigma_W: float | None
    """Eq. 31"""
    C: float | None
    """Eq. 40"""
    windows: tuple[WindowVerdict, ...]
    warnings: tuple[str, ...]
    seconds: float
    noise_ratio: float | None = None
    """rms of ε = W χ over what marker noise alone explains: 1 says that the model is right"""
    covariance: Float[np.ndarray, "9 9"] = field(default_factory=lambda: np.zeros((9, 9)))
    leave_one_out: Float[np.ndarray, "W 9"] | None = None
    alone: dict[str, np.ndarray] = field(default_factory=dict[str, np.ndarray])
    """window id → nine parameters, of windows that identify a body by themselves"""
    attachment_plane: float = 0.0
    """mean a_z of the cables, m: s_z is known only relative to it (gauge)"""
    freedoms: int = 2
    scaling_effect: Float[np.ndarray, "9"] | None = None
    """change of the parameters if the columns of W were scaled to norm 1; None for methods that do not depend on it"""
    geometry: Geometry | None = None
    """None for methods that take the robot file's geometry as exact"""
    removed: tuple[Removed, ...] = ()
    """what cleaning left out of the recordings"""
    fallback: str = ""
    """why this method is shown in the place of the one that suits the campaign; empty where it is that one"""
    cause: str = ""
    """what the model is seen to lack, a sentence that `answer` has too; empty where that is not seen"""

    @property
    def body(self) -> Body:
        """The identified body."""
        return Body.from_vector(np.array([self.parameters[name].value for name in PARAMETER_NAMES]))

    @property
    def nominal(self) -> Body:
        """What CAD says."""
        return Body.from_vector(np.array([self.parameters[name].nominal for name in PARAMETER_NAMES]))

    @property
    def no_sigma(self) -> str:
        """Why windows that are used have no σ⊥, for people; empty where each has one."""
        return no_sigma({w.id: w.no_sigma for w in self.windows if w.used and w.no_sigma})

    def about_com(self) -> dict[str, InertialParameter]:
        """I′ about G (m²) with its errors propagated: the moments that do not depend on the choice of P."""
        value, nominal = _central(self.body.vector), _central(self.nominal.vector)
        J = np.stack([(_central(self.body.vector + h) - value) / 1e-7 for h in 1e-7 * np.eye(9)], axis=1)
        sd = np.sqrt(np.diag(J @ self.covariance @ J.T))
        spread = None
        if self.leave_one_out is not None:
            spread = jackknife_sd(np.array([_central(row) for row in self.leave_one_out]))
        spreads = [None] * 6 if spread is None else [float(each) for each in spread]
        return {
            name: InertialParameter(
                float(value[k]),
                float(sd[k]),
                None,
                spreads[k],
                float(nominal[k]),
                seen=all(self.parameters[part].seen for part in (name, *parts)),
            )
            for k, (name, parts) in enumerate(MOVED_BY.items())
        }

    def to_json(self) -> dict[str, object]:
        """The result as "fidim-result/1" (spec/formats.md), ready for json.dump; what is unknown is null."""
        return {
            "format": "fidim-result/1",
            "campaign": self.campaign,
            "method": self.method.value,
            "outcome": self.outcome.code,
            "message": self.answer.message,
            "parameters": {
                name: {
                    "value": p.value if p.seen else None,
                    "sd": p.sd if p.seen else None,
                    "sd_bootstrap": p.sd_bootstrap if p.seen else None,
                    "nominal": p.nominal,
                    "seen": p.seen,
                }
                for name, p in self.parameters.items()
            },
            "non_essential": list(self.non_essential),
            "sigma_W": self.sigma_W,
            "C": self.C,
            "windows": [
                {
                    "id": w.id,
                    "role": w.role.value,
                    "chi2_per_dof": w.chi2_per_dof,
                    "rms_mm": w.rms_mm,
                    "sigma_perp": w.sigma_perp,
                    "used": w.used,
                }
                for w in self.windows
            ],
            "geometry": None if self.geometry is None else self.geometry.table,
            "removed": as_json(self.removed),
            "seconds": round(self.seconds, 3),
        }


def _central(values: np.ndarray) -> np.ndarray:
    inertia = Body.from_vector(values).inertia_about_com
    return inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
