"""What scaling and weighting are worth to total least squares: the paper's form, its columns scaled, and ours.

Total least squares is not invariant to the scaling of its columns (spec/model.md §3). The paper scales nothing; the
spread between the three columns of this table is uncertainty that no standard deviation contains.
"""

from dataclasses import dataclass

from rich.table import Table

from fidim_lab.app.terminal import console
from fidim_lab.identification.results.result import IdentificationResult
from fidim_lab.units import millimetres, plain


@dataclass(frozen=True, eq=False)
class Forms:
    """The same campaign by the paper's form, and by ours."""

    paper: IdentificationResult
    ours: IdentificationResult


def scaling_table(forms: Forms) -> Table:
    """Nine parameters in three forms, each with its nominal sd where it has one."""
    table = Table(title="Total least squares in three forms (s in mm, I in 1e-3 m² per unit mass, about P)")
    console.columns(table, "parameter", "CAD", "the paper's", "sd", "columns of norm 1", "moves by, sd", "ours", "sd")
    effect = forms.paper.scaling_effect
    for k, (name, paper) in enumerate(forms.paper.parameters.items()):
        ours = forms.ours.parameters[name]
        shown = paper.value, paper.sd, *(() if effect is None else (paper.value + effect[k],))
        middle = [f"{millimetres(v):.3f}" for v in shown] + ([] if effect is not None else ["–"])
        moved = "–" if effect is None or paper.sd == 0 else f"{effect[k] / paper.sd:+.1f}"
        table.add_row(
            name,
            f"{millimetres(paper.nominal):.3f}",
            *middle,
            moved,
            f"{millimetres(ours.value):.3f}",
            f"{millimetres(ours.sd):.3f}",
        )
    table.add_row("σ_W", "", _figure(forms.paper.sigma_W), "", "", "", _figure(forms.ours.sigma_W), "")
    table.add_row("C", "", _figure(forms.paper.C), "", "", "", _figure(forms.ours.C), "")
    return table


def _figure(value: float | None) -> str:
    return "–" if value is None else plain(value)
