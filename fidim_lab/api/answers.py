"""What the functions of the interface return: answers that print, become tables, and can be plotted."""

import io
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure
from rich.console import Console, RenderableType

from fidim_lab.data.records import Body, Plan
from fidim_lab.identification.cross_validation import CrossValidation
from fidim_lab.identification.design.search import Design
from fidim_lab.identification.results.result import IdentificationResult, ResultOutcome
from fidim_lab.identification.results.result_file import write_result
from fidim_lab.mismatch.conclusion.explanation import Explanation, Verdict, write_explanation

WIDE = 160
"""columns of a printed answer: no table of ours is wider"""


def as_text(renderable: RenderableType) -> str:
    """What a command prints, as a text without trailing blanks."""
    buffer = io.StringIO()
    Console(file=buffer, width=WIDE, highlight=False, color_system=None).print(renderable)
    return "\n".join(line.rstrip() for line in buffer.getvalue().splitlines())


@dataclass(frozen=True, eq=False, repr=False)
class Identified:
    """The identified body, as `fidim identify` answers."""

    result: IdentificationResult
    """everything: parameters, windows, covariance, warnings"""

    @property
    def ok(self) -> bool:
        """Whether `fidim identify` would end with 0: an answer, by the method that suits the campaign."""
        return self.result.outcome.answers and not self.result.fallback

    @property
    def outcome(self) -> ResultOutcome:
        """How it ended; its value is a sentence."""
        return self.result.outcome

    @property
    def body(self) -> Body:
        """Centre of mass (m, from P) and inertia (m², per unit mass, about P)."""
        return self.result.body

    def to_frame(self) -> pd.DataFrame:
        """A row a parameter: value, sd, spread between windows, nominal (CAD), in m and m²; seen, essential."""
        rows = {
            name: {
                "value": one.value,
                "sd": one.sd,
                "spread": one.spread,
                "nominal": one.nominal,
                "seen": one.seen,
                "essential": name not in self.result.non_essential,
            }
            for name, one in self.result.parameters.items()
        }
        return pd.DataFrame.from_dict(rows, orient="index").rename_axis("parameter")

    def windows(self) -> pd.DataFrame:
        """A row a window: role, used, samples, sigma_perp (m/s²), rms_mm, chi2_per_dof."""
        names = ("id", "role", "used", "samples", "sigma_perp", "rms_mm", "chi2_per_dof")
        table = pd.DataFrame([{name: getattr(one, name) for name in names} for one in self.result.windows])
        return table.assign(role=[one.role.value for one in self.result.windows]).set_index("id")

    def plot(self) -> Figure:
        """Each parameter's distance from CAD with its ±, mm and 1e-3 m²."""
        table = self.to_frame()
        figure = Figure(figsize=(8.0, 3.6), layout="constrained")
        axis = figure.subplots()
        error = table[["sd", "spread"]].astype(float).max(axis=1)
        axis.errorbar(table.index, 1e3 * (table["value"] - table["nominal"]), 1e3 * error, fmt="o", capsize=4)
        axis.axhline(0.0, color="0.6", lw=0.8)
        axis.set_ylabel("identified less CAD / mm, 1e-3 m²")
        axis.set_title(self.result.answer.message, fontsize="small", wrap=True)
        return figure

    def save(self, path: Path | str) -> None:
        """Write "fidim-result/1", as `fidim identify --json`. Raises SetupError where it cannot be written."""
        write_result(Path(path), self.result)

    def __str__(self) -> str:
        from fidim_lab.app.analysis.identified import summary

        return as_text(summary(self.result))

    def __repr__(self) -> str:
        s = ", ".join(f"{1e3 * value:.3f}" for value in self.body.com)
        return f"Identified({self.result.campaign!r}: {self.outcome.code}, s = ({s}) mm)"

    def _repr_html_(self) -> str:
        return f"<p>{self.result.answer.message}</p>{self.to_frame().to_html()}"


@dataclass(frozen=True, eq=False, repr=False)
class Explained:
    """What the model leaves out, as `fidim explain` answers."""

    explanation: Explanation
    """everything: effects, places, ranking, parameters before and after"""

    @property
    def verdict(self) -> Verdict:
        """Nothing missing, explained, partly explained, unknown physics, or a sensor's fault."""
        return self.explanation.verdict

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects that were left out, most important first; with the cable where it is one cable's."""
        return tuple(f"{e.id}:{e.cable}" if e.cable else e.id for e in self.explanation.effects)

    def to_frame(self) -> pd.DataFrame:
        """A row a parameter of a named effect: value, sd, unit (SI)."""
        rows = [
            {"effect": cause.id, "cable": cause.cable, "parameter": name, **vars(parameter)}
            for cause in self.explanation.effects
            for name, parameter in cause.parameters.items()
        ]
        return pd.DataFrame(rows, columns=["effect", "cable", "parameter", "value", "sd", "unit"])

    def ranking(self) -> pd.DataFrame:
        """A row a model that was tried: model, effects, held_out_chi2_per_dof, plausible, why, lost (in words)."""
        rows = [{"model": one.name, **vars(one)} for one in self.explanation.ranking]
        return pd.DataFrame(rows).drop(columns="forms")

    def plot(self) -> Figure:
        """Held-out χ²/dof of each model that was fitted."""
        fitted = self.ranking().dropna(subset="held_out_chi2_per_dof")
        figure = Figure(figsize=(8.0, 0.5 * len(fitted) + 1.2), layout="constrained")
        axis = figure.subplots()
        names = list(fitted["model"])
        axis.barh(names[::-1], list(fitted["held_out_chi2_per_dof"])[::-1])
        axis.axvline(1.0, color="0.4", lw=0.8)
        axis.set_xlabel("held-out χ²/dof (1: noise)")
        return figure

    def save(self, path: Path | str) -> None:
        """Write "fidim-explanation/1", as `fidim explain --json`. Raises SetupError where it cannot be written."""
        write_explanation(Path(path), self.explanation)

    def __str__(self) -> str:
        from fidim_lab.app.analysis.explain import summary

        return as_text(summary(self.explanation))

    def __repr__(self) -> str:
        return (
            f"Explained({self.explanation.campaign!r}: {self.verdict.value}: {', '.join(self.effects) or 'no effect'})"
        )

    def _repr_html_(self) -> str:
        return f"<p>{self.explanation.message}</p>{self.to_frame().to_html()}"


@dataclass(frozen=True, eq=False, repr=False)
class Validated:
    """Whether parameters predict windows that they were not found from, as `fidim validate` answers."""

    found: CrossValidation
    sigma_W: float | None
    """of the fit that the parameters come from"""

    @property
    def predicts(self) -> bool:
        """Whether every window that could be judged is predicted."""
        return self.found.predicts

    def to_frame(self) -> pd.DataFrame:
        """A row a window: role, predicted, sigma_perp and expected (m/s²), rms (m), chi2_per_dof, why."""
        return pd.DataFrame([{**vars(one), "role": one.role.value} for one in self.found.windows]).set_index("id")

    def plot(self) -> Figure:
        """χ²/dof of each window, and the limit."""
        table = self.to_frame()
        figure = Figure(figsize=(8.0, 3.2), layout="constrained")
        axis = figure.subplots()
        axis.bar(table.index, table["chi2_per_dof"].astype(float))
        axis.axhline(self.found.rule.chi2_per_dof, color="tab:red", lw=1.0)
        axis.set_ylabel("χ²/dof")
        return figure

    def __str__(self) -> str:
        from fidim_lab.app.analysis.validate import table

        return f"{as_text(table(self.found, self.sigma_W))}\n{self.found.message}"

    def __repr__(self) -> str:
        return f"Validated({'predicts' if self.predicts else 'does not predict'}: {self.found.message})"


@dataclass(frozen=True, eq=False, repr=False)
class Designed:
    """Equilibria and displacements that tell most, as `fidim design` answers."""

    design: Design

    @property
    def plan(self) -> Plan:
        """What `fidim run` and `simulate` take."""
        from fidim_lab.app.analysis.design import as_plan

        return as_plan(self.design)

    def save(self, path: Path | str) -> None:
        """Write the plan, "fidim-plan/1". Raises OSError."""
        from fidim_lab.data.plan_file import write_plan

        write_plan(Path(path), self.plan)

    def to_frame(self) -> pd.DataFrame:
        """A row a window: lengths, displacement, position (m), tension (N) lowest and highest, conditioning."""
        from fidim_lab.app.analysis.design import as_json

        table = pd.DataFrame(as_json(self.design)["equilibria"])
        return table.set_index(pd.Index([window.id for window in self.plan.windows], name="window"))

    def predicted_sd(self) -> pd.Series:
        """What maximum likelihood will reach, m and m²."""
        from fidim_lab.data.records import PARAMETER_NAMES

        return pd.Series(self.design.predicted_sd, index=list(PARAMETER_NAMES))

    def __repr__(self) -> str:
        return f"Designed({len(self.plan.windows)} equilibria, C = {self.design.C:.3f})"
