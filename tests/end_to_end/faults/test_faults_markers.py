"""Motion capture that fails."""

import pytest

from sim_backends.mocap.faults import STRAY_PLACE, Faults


@pytest.mark.fault(
    "motion capture",
    "the marker is hidden for 0.2 s",
    reaction="the window is recorded again",
    says="longest gap of the marker is 0.2 s",
    window="rejected, recorded again",
    journal="STEP_FINISHED",
)
def test_a_hidden_marker(rehearsal, fault):
    fault.strikes(rehearsal, lambda stage: stage.mocap.add("occlusions", 0.2))


@pytest.mark.fault(
    "motion capture",
    "the marker is hidden for 3 s",
    reaction="hold",
    within=3.1,
    says="the main marker is lost for 3.0",
    window="kept",
)
def test_a_lost_marker(rehearsal, scene, fault):
    rehearsal.settings = scene.short(seconds=6.0)
    fault.strikes(rehearsal, lambda stage: stage.mocap.add("occlusions", 4.0))


@pytest.mark.fault(
    "motion capture",
    "the marker is frozen for 0.2 s",
    reaction="the window is recorded again",
    says="longest gap of the marker is 0.",
    window="rejected, recorded again",
    journal="STEP_FINISHED",
)
def test_a_frozen_marker(rehearsal, fault):
    fault.strikes(rehearsal, lambda stage: stage.mocap.add("freezes", 0.2))


@pytest.mark.fault(
    "motion capture",
    "the marker is frozen for 3 s",
    reaction="hold",
    within=3.1,
    says="the main marker is frozen for 3.0",
    window="kept",
)
def test_a_marker_frozen_for_long(rehearsal, scene, fault):
    rehearsal.settings = scene.short(seconds=6.0)
    fault.strikes(rehearsal, lambda stage: stage.mocap.add("freezes", 4.0))


@pytest.mark.fault(
    "motion capture",
    "the marker jumps by 20 mm for 0.2 s",
    reaction="the window is recorded again",
    says="largest jump of marker 1 is ",
    window="rejected, recorded again",
    journal="STEP_FINISHED",
)
def test_a_jumping_marker(rehearsal, fault):
    fault.strikes(rehearsal, lambda stage: stage.mocap.add("jumps", 0.2, (0.02, 0.0, 0.0)))


@pytest.mark.fault(
    "motion capture",
    "the marker is taken for another, 0.15 m away",
    reaction="the window is recorded again",
    says="largest jump of marker 1 is ",
    window="rejected, recorded again",
    journal="STEP_FINISHED",
)
def test_a_swapped_marker(rehearsal, fault):
    fault.strikes(rehearsal, lambda stage: stage.mocap.add("jumps", 0.3, (0.1, 0.1, 0.05)))


@pytest.mark.fault(
    "motion capture",
    "packets are lost, doubled, torn and overtake one another",
    reaction="none",
    says="frames lost",
    window="accepted, blank where nothing came",
    journal="STEP_FINISHED",
)
def test_packets_in_disorder(scene, fault):
    rehearsal = scene.make(Faults(lost=0.003, doubled=0.03, reordered=0.05, torn=0.003))
    rehearsal.settings = scene.short(seconds=5.0)
    fault.strikes(rehearsal, lambda stage: None)


@pytest.mark.fault(
    "motion capture",
    "packets of an earlier session arrive among the others",
    reaction="none",
    says="i01",
    window="accepted, without one of them",
    journal="STEP_FINISHED",
)
def test_packets_of_an_old_session(rehearsal, scene, fault):
    ended = fault.strikes(rehearsal, lambda stage: stage.mocap.add("strays", 0.8), after=0.2)
    found = scene.places(ended.folder / "windows" / "i01.csv")
    first = ended.first_number(ended.folder / "windows" / "i01.csv")
    assert max(abs(place[0] - ended.truth[first + k][0]) for k, place in found.items()) < STRAY_PLACE / 10.0
    assert len(found) == ended.rows


@pytest.mark.fault(
    "motion capture",
    "the stream falls behind by half a second, repeating the frames that it had sent",
    reaction="the window is recorded again",
    says="shift of the frame numbers against this computer's clock is 0.5 s",
    window="rejected, recorded again",
    journal="STEP_FINISHED",
)
def test_a_stream_that_falls_behind(rehearsal, scene, fault):
    """Each frame has its own number still, but the winches' samples beside it are another time's."""
    rehearsal.settings = scene.short(seconds=3.0)
    fault.strikes(rehearsal, lambda stage: stage.mocap.add("replays", 1e3, 50), after=1.2)


@pytest.mark.fault(
    "motion capture",
    "the stream falls behind by 0.2 s under new numbers",
    reaction="the window is recorded again",
    says="longest repetition of earlier places of the marker is 0.2 s",
    window="rejected, recorded again",
    journal="STEP_FINISHED",
)
def test_a_stream_that_repeats_places_under_new_numbers(rehearsal, scene, fault):
    """The jump to a place of a similar phase is small, and numbers and times go on: the window was accepted."""
    rehearsal.settings = scene.short(seconds=3.0)
    fault.strikes(rehearsal, lambda stage: stage.mocap.add("replays", 2.0, 20, True), after=1.2)
