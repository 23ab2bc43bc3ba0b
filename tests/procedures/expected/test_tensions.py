"""How well a tension is known, and what that means against a limit: certainly within it, perhaps, or not."""

from dataclasses import replace

import numpy as np
import pytest

from drivers.ports import GaugeReading
from procedures.expected.tensions import by_current, known_tensions, measured
from procedures.outcomes import Outcome
from procedures.recording.journal import read_journal
from procedures.settings import TensionBand

DIRECTED = TensionBand(friction=3.0, load_friction=0.1, scatter=1.0)
LIMITS = (20.0, 200.0)


@pytest.mark.parametrize("true", [25.0, 60.0, 190.0])
@pytest.mark.parametrize("moved", [-1, 1])
def test_the_direction_of_the_last_move_takes_friction_out(true, moved):
    """From the physics: wound, the motor carries the load and its friction; paid out, the load less friction."""
    shown = true * (1.0 - moved * DIRECTED.load_friction) - moved * DIRECTED.friction
    known = by_current(shown, moved, DIRECTED)
    assert known.value == pytest.approx(true)
    assert known.band == 1.0
    unknown = by_current(shown, 0, DIRECTED)
    assert abs(unknown.value - true) < unknown.band + 2.0
    assert unknown.band > 3.0


def test_a_band_as_a_whole_and_none():
    assert by_current(50.0, 1, TensionBand(friction=15.0)).band == 15.0
    assert by_current(50.0, 1, None).band is None


@pytest.mark.parametrize(
    ("value", "outcome"),
    [(17.9, "fail"), (18.1, "marginal"), (21.9, "marginal"), (22.1, "pass"), (197.9, "pass"), (199.0, "marginal")],
)
def test_certainly_within_the_limits(value, outcome):
    assert measured(1, *known_tensions([0.0], [0], None, {1: (value, 1.0)}), LIMITS, 0.1).outcome == Outcome(outcome)


def test_without_a_band_the_tolerance_counts():
    for value, outcome in ((17.9, "fail"), (18.1, "marginal"), (20.1, "pass"), (221.0, "fail")):
        assert measured(1, by_current(value, 0, None), LIMITS, 0.1).outcome == Outcome(outcome)


def test_a_load_cell_is_taken_before_the_current():
    known = known_tensions([50.0, 50.0], [1, 1], (DIRECTED, DIRECTED), {2: (44.0, 0.5)})
    assert known[0].source == "motor current after paying out"
    assert (known[1].value, known[1].band, known[1].source) == (44.0, 1.0, "load cell")


class Cells:
    name, columns, age, uncertainty = "load cells", ("f1", "f2", "f3", "f4"), 0.3, 0.5

    def __init__(self, world, silent=False):
        self.world, self.silent = world, silent

    def latest(self):
        return None if self.silent else GaugeReading(self.world.now(), (61.0, 62.0, 63.0, 21.0))


def checked(world, lab, folder, cells):
    base = type(world)

    class Equipped(base):
        @property
        def rig(self):
            return replace(super().rig, gauges=(cells,))

    world.__class__ = Equipped
    world.run(lab.one, folder)
    entries = read_journal(folder / "journal.jsonl")
    return next(e for e in entries if e.step == "CheckTension" and "values" in e.data).data


def test_the_check_takes_load_cells_and_its_readings_are_kept(world, lab, tmp_path):
    data = checked(world, lab, tmp_path / "run", Cells(world))
    assert data["values"] == [61.0, 62.0, 63.0, 21.0]
    assert data["measurements"][3]["name"] == "tension of cable 4 (± 1.0 N by load cell)"
    assert data["readings"]["load_cells"] == [61.0, 62.0, 63.0, 21.0]
    assert data["readings"]["currents"] == pytest.approx([60.0 / 34.0] * 4, abs=1e-4)
    assert data["readings"]["lengths"] == pytest.approx([1.5, 1.4, 1.4, 1.4], abs=1e-4)


def test_silent_load_cells_leave_it_to_the_currents(world, lab, tmp_path):
    band = TensionBand(friction=2.0, scatter=0.5)
    world.settings = replace(world.settings, tension=replace(world.settings.tension, bands=(band,) * 4))
    data = checked(world, lab, tmp_path / "run", Cells(world, silent=True))
    assert np.allclose(data["values"], 60.0 * world.robot.winches[0].newton_per_ampere / 34.0, rtol=0.05)
    assert "last direction unknown" in data["measurements"][0]["name"]
    assert "load_cells" not in data["readings"]
