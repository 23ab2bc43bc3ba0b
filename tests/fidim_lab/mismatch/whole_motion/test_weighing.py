"""Two models of whole windows against each other."""

from dataclasses import dataclass

import pytest

from fidim_lab.mismatch.whole_motion.weighing import log_odds, odds_of_all, taken


@dataclass(frozen=True)
class Predicted:
    chi2: float
    dof: int = 100


@dataclass(frozen=True)
class Model:
    """What weighing asks of one."""

    fitted: float
    """sum of squares"""
    held: dict[str, Predicted]
    temper: float = 50.0

    def nats(self, temper: float) -> float:
        return -0.5 * self.fitted / temper


def test_what_fits_better_and_predicts_worse_is_no_likelier_by_all_windows() -> None:
    """As friction that gives way at the swivels did on the paper's takes with three cables."""
    named = Model(9000.0, {"v1": Predicted(4000.0), "v2": Predicted(3000.0)})
    rival = Model(8000.0, {"v1": Predicted(5000.0), "v2": Predicted(3500.0)}, temper=60.0)
    assert log_odds(named, rival) == pytest.approx(-10.0)
    assert taken(named, rival) < 0.0
    assert odds_of_all(named, rival) == pytest.approx(5.0)
    assert odds_of_all(rival, named) == pytest.approx(-5.0)


def test_windows_that_one_of_them_loses_are_not_counted() -> None:
    named = Model(9000.0, {"v1": Predicted(4000.0)})
    rival = Model(9000.0, {"v1": Predicted(4100.0), "v2": Predicted(1e6)})
    assert odds_of_all(named, rival) == pytest.approx(1.0)
