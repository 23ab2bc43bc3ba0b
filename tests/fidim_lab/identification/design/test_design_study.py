"""The study over equilibria and samples: its cells are what single starts give, and its plot shows them."""

from pathlib import Path

import pytest

from fidim_lab.app.analysis.design_study import write_study
from fidim_lab.identification.design.study import study


@pytest.mark.slow
def test_more_equilibria_tell_more(drawn, tmp_path: Path):
    cells = study(drawn.task, 1, 5, map, lambda _: None, equilibria=(2, 4), samples=(20,))
    assert [(cell.equilibria, cell.samples) for cell in cells] == [(2, 20), (4, 20)]
    assert cells[1].best < cells[0].best
    write_study(cells, tmp_path / "study.svg")
    assert "20 samples" in (tmp_path / "study.svg").read_text()
