"""How late the markers are, found by a jog on simulated drives and cameras; kept, and used by whoever reads."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers.disk import InlineDisk
from fidim_lab.app import compose
from fidim_lab.app.formats.aligned import AlignmentKeeper, known_alignment
from fidim_lab.data.records import Plan, PlannedWindow, Role
from fidim_lab.data.rigs.alignment_file import NAME, alignment_path, at_exposures, read_alignment
from fidim_lab.data.rigs.rig_file import read_rig
from fidim_lab.data.window_csv import read_window_csv
from fidim_lab.errors import InfeasibleError, SetupError
from fidim_lab.model.closure import closure_at
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.marker_lag import marker_lag
from fidim_lab.model.mechanism import Mechanism
from procedures.outcomes import Outcome
from procedures.protocols.align import align
from procedures.protocols.catalogue import experiment
from procedures.protocols.experiment import Lab
from procedures.run import run_procedure
from procedures.settings import AlignSettings, MotionSettings, Settings
from sim_backends import laboratory
from sim_backends.mocap.server import MocapServer

RIG = Path(__file__).parents[3] / "examples" / "rigs" / "simulated.toml"
LATENCY, JITTER = 6e-3, 0.3e-3
PLACE = PlannedWindow(
    "a01",
    Role.IDENTIFY,
    np.array([1.30283, 1.39119, 1.52772, 1.41231]),
    np.array([-0.02, 0.03]),
    np.array([1.111, -0.271, -0.315]),
)
PLAN = Plan("one place", (PLACE,))
SETTINGS = Settings(motion=MotionSettings(settle_over=0.3), align=AlignSettings(seconds=12.0))


def carried_out(robot, folder, monkeypatch, listeners=()):
    """`align` on simulated devices whose cameras are late."""

    def late(**more):
        timing = replace(more.pop("timing"), latency=LATENCY, jitter=JITTER)
        return MocapServer(timing=timing, **more)

    monkeypatch.setattr(laboratory, "MocapServer", late)
    made = experiment("align", PLAN, robot, SETTINGS)

    async def main():
        world = compose.simulated_world(robot, 3, ())
        async with compose.simulated_rig(robot, PLAN, world, 3) as rig:
            return await run_procedure(
                made, rig.rig, folder, wall_time=lambda: "2026-01-01T00:00:00Z", listeners=listeners
            )

    return compose.run_loop(main(), real_time=False)


@pytest.fixture(scope="module")
def rig_file():
    return read_rig(RIG)


@pytest.fixture(scope="module")
def jogged(irma4, rig_file, tmp_path_factory):
    folder = tmp_path_factory.mktemp("jog")
    file = replace(rig_file, path=folder / "rig.toml")
    keeper = AlignmentKeeper(file, folder / "run", lambda: "2026-01-01T00:00:00Z", pytest.fail, InlineDisk())
    with pytest.MonkeyPatch.context() as patch:
        return carried_out(irma4, folder / "run", patch, (keeper,)), folder / "run", file


def test_the_lag_of_late_cameras_is_found(jogged):
    report, folder, _ = jogged
    assert report.outcome is Outcome.PASS, report.reason
    found = read_alignment(folder / NAME)
    late = LATENCY + JITTER  # on average; how old the newest sample of an encoder was does not count any more
    assert abs(found.lag - late) < min(3.0 * found.sd, 5e-4), found
    assert found.sd < 5e-4
    assert found.correlation > 0.99


def test_read_at_the_exposures_lengths_show_what_the_cameras_saw(jogged, irma4):
    _, folder, _ = jogged
    found = read_alignment(folder / NAME)
    columns = read_window_csv(folder / "alignment" / "a01.csv", irma4.n)
    mechanism = Mechanism(irma4)
    rest = equilibrium_at(mechanism, irma4.nominal, PLACE.position)
    signal = closure_at(mechanism, rest.pose, np.array(irma4.markers))
    again = marker_lag(signal, columns.t, at_exposures(columns.t, columns.lengths, found.lag), columns.markers)
    assert abs(again.offset) < 3.0 * found.sd


def test_it_is_kept_beside_the_rig_and_refused_for_another_motion_capture(jogged):
    _, folder, file = jogged
    assert known_alignment(file) == read_alignment(folder / NAME) == read_alignment(alignment_path(file.path))
    assert known_alignment(replace(file, keeps_homes=False)) is None  # a rehearsal's cameras are others
    other = replace(file, motion_capture=replace(file.motion_capture, rate=200.0))
    with pytest.raises(SetupError, match=r"measured with motion_capture.rate 100.0.* says 200.0"):
        known_alignment(other)


def test_one_place_with_room(irma4):
    with pytest.raises(SetupError, match="has 2 windows"):
        align(Lab(Plan("two", (PLACE, replace(PLACE, id="a02"))), irma4))
    with pytest.raises(InfeasibleError):
        align(Lab(PLAN, irma4, replace(SETTINGS, align=AlignSettings(amplitude=0.4))))
    with pytest.raises(SetupError, match=r"show 0\.0 mm of this jog twice"):
        align(Lab(PLAN, irma4, replace(SETTINGS, align=AlignSettings(amplitude=1e-5))))
