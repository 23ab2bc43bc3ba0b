"""The one cleaning: what stands for a blank, was computed, stamped on arrival, held or pushed; and nothing else."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import butter, lfilter, lfilter_zi, sosfiltfilt

from fidim_lab.data.records import Body, Campaign, Window
from fidim_lab.errors import RefusedError
from fidim_lab.identification.cleaning.clean import clean_recordings
from fidim_lab.identification.cleaning.knocked import moved_in
from fidim_lab.identification.cleaning.low_pass import low_passed
from fidim_lab.identification.cleaning.repeated import without_held
from fidim_lab.identification.equations.estimators import Method
from fidim_lab.identification.identify import identify

NOISE = 1e-4
Make = Callable[..., Campaign]


def each(campaign: Campaign, change: Callable[[np.ndarray], np.ndarray]) -> Campaign:
    """Markers of every window changed, written with six decimals."""
    windows = (replace(w, markers=np.round(change(w.markers.copy()), 6)) for w in campaign.windows)
    return replace(campaign, windows=tuple(windows))


def of_rows(window: Window, markers: np.ndarray) -> Window:
    """As many rows as there are markers, at 100 Hz."""
    assert window.lengths is not None
    lengths = np.tile(window.lengths[0], (len(markers), 1))
    return replace(window, t=np.arange(len(markers)) / 100, markers=markers, lengths=lengths)


@pytest.mark.parametrize("cluster", [False, True])
def test_nothing_is_taken_from_a_clean_campaign(recorded: Make, cluster: bool):
    campaign = each(recorded(noise=NOISE, cluster=cluster), lambda markers: markers)
    found = clean_recordings(campaign).recordings
    assert found.removed == ()
    assert found.notes == ()
    for before, after in zip(campaign.windows, found.campaign.windows, strict=True):
        np.testing.assert_array_equal(before.markers, after.markers)
        np.testing.assert_array_equal(before.t, after.t)


@pytest.mark.parametrize("value", [0.0, -1.0, 9999.0])
@pytest.mark.parametrize("cluster", [False, True])
def test_placeholders_are_missing(recorded: Make, value: float, cluster: bool):
    def spoil(markers: np.ndarray) -> np.ndarray:
        markers[40:43] = markers[200] = markers[-1] = value
        return markers

    found = clean_recordings(each(recorded(noise=NOISE, cluster=cluster), spoil)).recordings
    for window in found.campaign.windows:
        gone = ~np.isfinite(window.markers).all(axis=(1, 2))
        assert np.flatnonzero(gone).tolist() == [40, 41, 42, 200, 600]
    assert {one.why for one in found.removed} == {"placeholder for a blank"}
    assert "count as missing" in found.notes[0]


@pytest.mark.parametrize("fill", ["line", "cubic", "held"])
def test_computed_samples_are_missing(recorded: Make, fill: str):
    def spoil(markers: np.ndarray) -> np.ndarray:
        share = np.linspace(0, 1, 42)[1:-1, None, None]
        share = {"line": share, "cubic": 3 * share**2 - 2 * share**3, "held": 0 * share}[fill]
        markers[100:140] = markers[99] + share * (markers[140] - markers[99])
        return markers

    found = clean_recordings(each(recorded(noise=NOISE), spoil)).recordings
    for window in found.campaign.windows:
        gone = np.flatnonzero(~np.isfinite(window.markers[:, 0, 0]))
        assert set(range(100, 140)) <= set(gone.tolist()) <= set(range(96, 144))


def test_rounded_places_that_stand_still_at_a_reversal_stay(recorded: Make):
    """Of a slow motion without noise, written in whole millimetres."""

    def slow(markers: np.ndarray) -> np.ndarray:
        swing = 0.01 * np.sin(2 * np.pi * 0.5 * np.arange(len(markers)) / 100)
        return np.round(markers[:1] + swing[:, np.newaxis, np.newaxis] * [1.0, 0.7, 0.4], 3)

    assert not without_held(each(recorded(noise=0.0), slow)).removed


@pytest.mark.parametrize("fill", ["line", "cubic"])
def test_computed_samples_are_missing_where_numbers_have_six_digits_in_all(recorded: Make, fill: str):
    """As Nexus and C's %g write mm: three decimals up to 999.999, two from 1000.00 on."""

    up = np.array([0.0, 0.0, 2.0])

    def spoil(markers: np.ndarray) -> np.ndarray:
        markers = markers + up
        share = np.linspace(0, 1, 42)[1:-1, None, None]
        share = share if fill == "line" else 3 * share**2 - 2 * share**3
        markers[100:140] = markers[99] + share * (markers[140] - markers[99])
        return np.vectorize(lambda x: 1e-3 * float(f"{1e3 * x:.6g}"))(markers)

    campaign = recorded(noise=NOISE)
    cables = tuple(replace(cable, d=cable.d + up) for cable in campaign.robot.cables)
    spoilt = each(replace(campaign, robot=replace(campaign.robot, cables=cables)), spoil)
    found = clean_recordings(spoilt).recordings
    for window in found.campaign.windows:
        assert np.nanmin(window.markers[:, 0, 2]) > 1.0
        gone = np.flatnonzero(~np.isfinite(window.markers[:, 0, 0]))
        assert set(range(100, 140)) <= set(gone.tolist()) <= set(range(96, 144))


@pytest.mark.parametrize("every", [2, 3, None])
@pytest.mark.parametrize("cluster", [False, True])
def test_repeated_frames_are_missing(recorded: Make, every: int | None, cluster: bool):
    rows = np.arange(601)
    known = rows % every == 0 if every else ~np.isin(rows, [50, 120, 121, 300])
    last = np.maximum.accumulate(np.where(known, rows, 0))
    found = clean_recordings(each(recorded(noise=NOISE, cluster=cluster), lambda markers: markers[last])).recordings
    for window in found.campaign.windows:
        np.testing.assert_array_equal(np.isfinite(window.markers).all(axis=(1, 2)), known)
    assert {one.why for one in found.removed} == {"repeats the frame before"}


@pytest.mark.parametrize("markers", [slice(None), slice(1, 2)])
def test_a_place_that_is_kept_while_the_motion_goes_on_is_no_hand(recorded: Make, markers: slice):
    gaps = [(60, 100), (102, 130), (300, 380)]

    def spoil(places: np.ndarray) -> np.ndarray:
        for begin, end in gaps:
            places[begin:end, markers] = places[begin - 1, markers]
        return places

    found = clean_recordings(each(recorded(noise=NOISE, cluster=True), spoil)).recordings
    gone = np.concatenate([np.arange(*gap) for gap in gaps])
    for window in found.campaign.windows:
        assert np.flatnonzero(~np.isfinite(window.markers[:, markers]).all(axis=(1, 2))).tolist() == gone.tolist()
    assert {one.why for one in found.removed} == {"repeats the frame before"}
    assert "while the motion continues" in found.notes[0]


def test_a_hand_that_holds_without_noise_is_a_hand(recorded: Make):
    """As another simulator writes it: what is let go does not catch up with anything."""

    def held(window: Window) -> Window:
        speeds = np.linalg.norm(np.diff(window.markers, axis=0), axis=(1, 2))
        slowest = int(np.argmin(speeds[:300]))
        held = np.repeat(window.markers[slowest : slowest + 1], 150, axis=0)
        return of_rows(window, np.concatenate([held, window.markers[slowest:]]))

    campaign = recorded(noise=0.0, cluster=True)
    found = clean_recordings(replace(campaign, windows=tuple(map(held, campaign.windows)))).recordings
    assert "repeats the frame before" not in {one.why for one in found.removed}
    assert all(not np.isfinite(w.markers[:140]).any() for w in found.campaign.windows)


def test_places_that_are_equal_by_rounding_are_measured(recorded: Make):
    campaign = recorded(noise=NOISE)
    windows = (replace(w, markers=np.round(w.markers, 3)) for w in campaign.windows)
    found = clean_recordings(replace(campaign, windows=tuple(windows))).recordings
    assert "repeats the frame before" not in {one.why for one in found.removed}


def test_every_second_sample_by_a_line_is_missing(recorded: Make):
    def spoil(markers: np.ndarray) -> np.ndarray:
        markers[1:-1:2] = 0.5 * (markers[:-2:2] + markers[2::2])
        return markers

    found = clean_recordings(each(recorded(noise=NOISE), spoil)).recordings
    for window in found.campaign.windows:
        seen = np.isfinite(window.markers[:, 0, 0])
        assert seen[2:-2:2].mean() > 0.95
        assert seen[1:-1:2].mean() < 0.05


@pytest.mark.parametrize("bunched", [False, True])
def test_times_of_arrival_become_even(recorded: Make, bunched: bool):
    campaign, random = recorded(noise=NOISE), np.random.default_rng(3)

    def late(window: Window) -> Window:
        delay = random.exponential(4e-3, len(window.t))
        if bunched:
            hit = random.random(len(window.t)) < 0.08
            delay[hit] += random.uniform(0.02, 0.06, int(hit.sum()))
        return replace(window, t=np.maximum.accumulate(window.t + delay) + 1e-6 * np.arange(len(delay)))

    found = clean_recordings(replace(campaign, windows=tuple(late(w) for w in campaign.windows))).recordings
    for window in found.campaign.windows:
        np.testing.assert_allclose(np.diff(window.t), 0.01, atol=1e-9)
    assert "times of arrival" in found.notes[0]


def test_jitter_below_the_noise_is_told_where_many_markers_are_seen(recorded: Make):
    campaign, random = recorded(noise=2e-3, cluster=True), np.random.default_rng(4)
    windows = (replace(w, t=w.t + random.exponential(4e-3, len(w.t)).clip(max=9e-3)) for w in campaign.windows)
    found = clean_recordings(replace(campaign, windows=tuple(windows))).recordings
    for window in found.campaign.windows:
        np.testing.assert_allclose(np.diff(window.t), 0.01, atol=1e-9)


def test_true_uneven_stamps_stay(recorded: Make):
    """Samples that were taken when their stamps say are as smooth on them as on any grid."""
    campaign = recorded(noise=NOISE)
    windows = []
    for window in campaign.windows:
        t = window.t + 3e-3 * np.sin(np.arange(len(window.t)))
        columns = [np.interp(t, window.t, column) for column in window.markers[:, 0].T]
        windows.append(replace(window, t=t, markers=np.stack(columns, axis=1)[:, None]))
    found = clean_recordings(replace(campaign, windows=tuple(windows))).recordings
    for before, after in zip(windows, found.campaign.windows, strict=True):
        np.testing.assert_array_equal(before.t, after.t)


@pytest.mark.parametrize("cluster", [False, True])
@pytest.mark.parametrize("seconds", [0.6, 2.0])
@pytest.mark.parametrize("cad", [1.0, 1.6])
def test_a_platform_that_is_held_at_first_is_cut_at_its_release(
    recorded: Make, cluster: bool, seconds: float, cad: float
):
    """Held away from rest: the released motion begins at its largest displacement. A wrong CAD decides nothing."""
    campaign = recorded(cluster=cluster)
    robot = replace(
        campaign.robot, nominal=replace(campaign.robot.nominal, inertia=cad * campaign.robot.nominal.inertia)
    )
    random = np.random.default_rng(5)
    windows = []
    for window in campaign.windows:
        start = 100 + int(np.argmax(np.abs(window.markers[100:300, 0, 0] - window.markers[:, 0, 0].mean())))
        held = np.repeat(window.markers[start : start + 1], round(100 * seconds), axis=0)
        markers = np.concatenate([held, window.markers[start:]])
        windows.append(of_rows(window, markers + NOISE * random.standard_normal(markers.shape)))
    found = clean_recordings(replace(campaign, robot=robot, windows=tuple(windows))).recordings
    for window in found.campaign.windows:
        begin = window.t[np.isfinite(window.markers[:, 0, 0])][0]
        assert seconds - 0.02 <= begin <= seconds + 0.3
    assert "not free (held, pushed or touched)" in found.notes[-1]


@pytest.mark.parametrize("cluster", [False, True])
def test_what_is_free_before_and_after_a_hand_becomes_two_windows(recorded: Make, cluster: bool):
    campaign = recorded(noise=NOISE, cluster=cluster)
    first = campaign.windows[0]
    held = np.repeat(first.markers[250:251], 80, axis=0)
    markers = np.concatenate([first.markers[:250], held + NOISE * np.random.default_rng(1).standard_normal(held.shape)])
    markers = np.concatenate([markers, first.markers[250:]])
    spoilt = replace(campaign, windows=(of_rows(first, markers), *campaign.windows[1:]))
    found = clean_recordings(spoilt).recordings
    assert [w.id for w in found.campaign.windows] == ["w1", "w1, part 2", "w2", "w3", "w4", "w5"]
    (hand,) = found.removed
    assert hand.window == "w1"
    assert 2.0 <= hand.t[0] <= 2.52
    assert 3.28 <= hand.t[1] <= 3.8


@pytest.mark.parametrize("by", [0.004, 0.03])
def test_a_knocked_marker_is_missing_from_then_on(recorded: Make, by: float):
    campaign = recorded(noise=NOISE, cluster=True)
    windows = list(campaign.windows)
    for k in (2, 3, 4):
        markers = windows[k].markers.copy()
        markers[:, 2] += by * np.array([0.6, -0.64, 0.48])
        windows[k] = replace(windows[k], markers=markers)
    found = clean_recordings(replace(campaign, windows=tuple(windows))).recordings
    seen = [np.isfinite(w.markers[:, :, 0]).any(axis=0).tolist() for w in found.campaign.windows]
    assert seen == [[True] * 4] * 2 + [[True, True, False, True]] * 3
    assert "Marker 3 is not where the robot file has it in w3, w4, w5" in " ".join(found.notes)


@pytest.mark.parametrize("by", [0.0, 0.001, 0.002])
def test_a_marker_that_is_a_little_aside_is_told_for_a_window_that_contradicts_the_others(recorded: Make, by: float):
    """Too little to be told from a calibration of cameras, unless the motion contradicts, too."""
    campaign = recorded(noise=NOISE, cluster=True)
    windows = list(campaign.windows)
    aside = windows[2].markers.copy()
    aside[:, 1] += by * np.array([0.6, -0.64, 0.48])
    windows[2] = replace(windows[2], markers=aside)
    spoilt = replace(campaign, windows=tuple(windows))
    assert clean_recordings(spoilt).recordings.notes == ()
    says = moved_in(spoilt, "w3")
    assert says.startswith(" Marker 2 was elsewhere on the body there") if by else not says
    assert moved_in(spoilt, "w2") == ""


def test_what_is_missed_for_a_filter_is_told_as_the_filter_alone(recorded: Make):
    b, a = butter(2, 4.0, fs=100.0)
    found = identify(
        each(recorded(noise=NOISE, cluster=True), lambda seen: lfilter(b, a, seen - seen[0], axis=0) + seen[0]),
        Method.LS,
    )
    assert not found.outcome.answers
    assert found.answer.verdict.startswith("The markers were low-passed")
    assert found.answer.next.startswith("Export the markers as the cameras saw them")
    assert found.warnings == ()


@pytest.mark.parametrize(
    ("turn", "shift", "said"),
    [
        (33.0, (0.4, -0.2, 0.1), "it is turned by 33.0° about"),
        (0.0, (0.3, 0.0, 0.0), "it is not turned and shifted by (300, 0, 0) mm"),
    ],
)
def test_another_capture_frame_is_refused_with_its_turn_and_shift(
    recorded: Make, turn: float, shift: tuple[float, ...], said: str
):
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    matrix = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    spoilt = each(recorded(noise=NOISE), lambda markers: markers @ matrix.T + np.array(shift))
    with pytest.raises(RefusedError, match=r"The motion capture's frame is not the robot's") as refused:
        clean_recordings(spoilt)
    assert said in str(refused.value)


def test_a_frame_that_cures_a_little_and_not_down_to_noise_is_only_perhaps_the_cause(recorded: Make):
    """Pulleys of another size look the same; a refusal would name one of several causes."""
    campaign = recorded(noise=NOISE)
    cables = tuple(replace(cable, radius=cable.radius + 0.003) for cable in campaign.robot.cables)
    file = replace(campaign, robot=replace(campaign.robot, cables=cables))
    (note,) = [one for one in clean_recordings(file).recordings.notes if "contradict the robot file" in one]
    assert "The motion capture's frame is not the robot's" in note
    assert "fidim register" in note


def test_a_marker_elsewhere_on_the_body_is_refused_with_its_offset(recorded: Make):
    campaign = recorded(noise=NOISE)
    file = replace(campaign.robot, marker=campaign.robot.marker + np.array([0.03, -0.02, 0.04]))
    with pytest.raises(
        RefusedError, match=r"The marker is not where the robot file has it on the body, but \(-30, 20, "
    ):
        clean_recordings(replace(campaign, robot=file))


@pytest.mark.parametrize("cutoff", [6.0, 12.0])
def test_low_passed_markers_are_told_with_their_cutoff(recorded: Make, cutoff: float):
    campaign = recorded(noise=NOISE)
    b, a = butter(2, cutoff, fs=100.0)

    def through(markers: np.ndarray) -> np.ndarray:
        flat = markers.reshape(len(markers), -1)
        return lfilter(b, a, flat, axis=0, zi=lfilter_zi(b, a)[:, None] * flat[0])[0].reshape(markers.shape)

    assert low_passed(each(campaign, lambda markers: markers)) is None
    found = low_passed(each(campaign, through))
    assert found is not None
    assert found.cutoff == pytest.approx(cutoff, rel=0.25)
    assert "Export them unfiltered" in found.says


def test_cameras_that_are_better_than_stated_are_not_low_passed(recorded: Make) -> None:
    """Their noise is white, an eighth of what the robot file says."""
    assert low_passed(each(recorded(noise=NOISE / 8), lambda markers: markers)) is None


def test_a_steep_filter_leaves_the_files_rounding_alone(recorded: Make) -> None:
    sections = butter(8, 12.0, fs=100.0, output="sos")
    campaign = each(
        recorded(noise=NOISE), lambda markers: sosfiltfilt(sections, markers, axis=0, padlen=min(60, len(markers) - 1))
    )
    found = low_passed(campaign)
    assert found is not None
    assert found.cutoff == pytest.approx(12.0, rel=0.4)


def test_a_rate_that_header_and_stamps_say_otherwise_widens_or_is_decided(recorded: Make, true_body):
    """The stamps are a thousandth late: the true body lies within the ± that are stated."""
    campaign = recorded(noise=NOISE)
    windows = tuple(replace(w, t=1.001 * w.t) for w in campaign.windows)
    found = identify(replace(campaign, windows=windows), native=True)
    errors = [abs(p.value - true) / p.sd for p, true in zip(found.parameters.values(), true_body.vector, strict=True)]
    assert max(errors) < 3.5
    assert "The time stamps say 99.9001 Hz, campaign.toml says 100 Hz" in " ".join(found.warnings)


def test_a_rate_that_a_clock_makes_uneven_widens_or_is_decided(recorded: Make, true_body: Body):
    """Stamps of a computer whose clock is being set right: no header says that the cameras took 100 Hz."""
    campaign = recorded(noise=NOISE, cluster=True)
    windows = tuple(replace(w, t=1.0005 * w.t) for w in campaign.windows)
    found = identify(replace(campaign, sample_rate=100 / 1.0005, windows=windows), Method.MLE, native=True)
    errors = [abs(p.value - true) / p.sd for p, true in zip(found.parameters.values(), true_body.vector, strict=True)]
    assert max(errors) < 3.5
    assert found.outcome.answers
    assert "99.95 Hz may be 100 Hz by a clock that is off" in " ".join(found.warnings)


@pytest.mark.parametrize("taken", [60.0 / 1.001, 60.0])
@pytest.mark.sampled(1)
def test_sixty_frames_may_be_those_of_video(recorded: Make, true_body: Body, taken: float):
    """A header of 60 Hz: the body was 20 stated ± off, and the geometry called wrong, where cameras took 59.94."""

    def seen(window: Window) -> Window:
        times = np.arange(0.0, window.t[-1], 1.0 / taken)
        flat = window.markers.reshape(len(window.t), -1)
        markers = CubicSpline(window.t, flat)(times).reshape(len(times), *window.markers.shape[1:])
        markers = markers + NOISE * np.random.default_rng(int(window.id[1:])).standard_normal(markers.shape)
        return replace(of_rows(window, markers), t=np.arange(len(times)) / 60.0)

    exact = recorded(cluster=True)
    campaign = replace(exact, sample_rate=60.0, windows=tuple(seen(window) for window in exact.windows))
    found = identify(campaign, Method.MLE, native=True)
    errors = [abs(p.value - true) / p.sd for p, true in zip(found.parameters.values(), true_body.vector, strict=True)]
    assert max(errors) < 3.5
    assert found.outcome.answers
    video = [words for words in found.warnings if "follow video" in words]
    assert bool(video) == (taken < 60.0)


@pytest.mark.parametrize("cluster", [False, True])
@pytest.mark.parametrize(("factor", "fewest", "most"), [(0.5, 45, 65), (2.0, 160, 220)])
def test_a_clock_that_gravity_contradicts_is_refused_with_its_rate(
    recorded: Make, cluster: bool, factor: float, fewest: float, most: float
):
    """Samples were taken at 100 Hz times this factor; header and stamps agree on 100 Hz."""
    recording = each(recorded(noise=NOISE, cluster=cluster), lambda markers: markers)
    as_taken = tuple(at_times(w, factor) for w in recording.windows)
    with pytest.raises(RefusedError, match="By gravity") as refused:
        clean_recordings(replace(recording, windows=as_taken))
    named = float(re.findall(r"at about ([0-9.]+) Hz", str(refused.value))[0])
    assert fewest <= named <= most


def at_times(window: Window, factor: float) -> Window:
    """What a camera of so many times the rate takes of the same motion, stamped with the usual steps."""
    taken = np.arange(0.0, window.t[-1], 0.01 / factor)
    flat = window.markers.reshape(len(window.t), -1)
    noise = 0.3 * NOISE * np.random.default_rng(2).standard_normal((len(taken), flat.shape[1]))
    markers = np.column_stack([np.interp(taken, window.t, column) for column in flat.T]) + noise
    return of_rows(window, markers.reshape(len(taken), *window.markers.shape[1:]))


def test_a_window_that_was_retimed_by_the_header_is_not_stretched_once_more(recorded: Make, true_body):
    """The others keep their stamps: two clocks in one campaign, each brought to the same rate."""
    campaign = recorded(noise=NOISE)
    late = np.random.default_rng(5).exponential(3e-3, len(campaign.windows[0].t))
    windows = [replace(w, t=1.003 * w.t) for w in campaign.windows]
    windows[0] = replace(
        windows[0], t=np.maximum.accumulate(np.round(windows[0].t + late, 6) + 1e-6 * np.arange(len(late)))
    )
    found = identify(replace(campaign, windows=tuple(windows)), Method.MLE, native=True)
    errors = [abs(p.value - true) / p.sd for p, true in zip(found.parameters.values(), true_body.vector, strict=True)]
    assert "are times of arrival" in " ".join(found.warnings)
    assert "The recordings are explained better with 100 Hz" in " ".join(found.warnings)
    assert all(window.used for window in found.windows)
    assert max(errors) < 3.5


def test_a_rate_is_read_from_all_stamps_where_their_last_digit_hides_it_in_one_step(recorded: Make, true_body):
    """The median step is that of the header then."""
    campaign = recorded(noise=NOISE)
    windows = tuple(replace(w, t=np.round(w.t / 1.0035, 4)) for w in campaign.windows)
    found = identify(replace(campaign, windows=windows), Method.MLE, native=True)
    errors = [abs(p.value - true) / p.sd for p, true in zip(found.parameters.values(), true_body.vector, strict=True)]
    assert max(errors) < 3.5
    assert "The time stamps say 100.35 Hz" in found.warnings[0]
    assert "better with 100 Hz" in found.warnings[0] or "each ± includes" in found.warnings[0]


def test_markers_get_the_names_of_the_robot_file(recorded: Make):
    campaign = recorded(noise=NOISE, cluster=True)
    order = np.array([2, 0, 3, 1])
    mixed = replace(campaign, windows=tuple(replace(w, markers=w.markers[:, order]) for w in campaign.windows))
    found = clean_recordings(mixed).recordings
    for right, mended in zip(campaign.windows, found.campaign.windows, strict=True):
        np.testing.assert_array_equal(right.markers, mended.markers)
    assert "its markers 1 to 4 are the recorded 2, 4, 1, 3" in found.notes[0]


def test_names_that_are_exchanged_for_a_while_are_put_right(recorded: Make):
    campaign = recorded(noise=NOISE, cluster=True)

    def exchange(markers: np.ndarray) -> np.ndarray:
        markers[200:260, [1, 3]] = markers[200:260, [3, 1]]
        return markers

    found = clean_recordings(each(campaign, exchange)).recordings
    for right, mended in zip(each(campaign, lambda m: m).windows, found.campaign.windows, strict=True):
        np.testing.assert_array_equal(right.markers, mended.markers)
    assert "exchanged in some samples of w1 (60)" in found.notes[0]


def test_a_window_that_shows_little_follows_the_others_of_its_clock(recorded: Make):
    """Arrivals that are 1 ms late hide in the noise of a window that hardly moves; its recorder is that of all."""
    campaign, random = recorded(noise=NOISE), np.random.default_rng(5)
    windows = []
    for k, window in enumerate(campaign.windows):
        delay = np.sort(random.exponential(4e-3, len(window.t)).reshape(-1, 1), axis=1)[:, 0]
        markers = window.markers
        if k == 0:
            middle = markers.mean(axis=0)
            markers = middle + 0.05 * (markers - middle) + NOISE * random.standard_normal(markers.shape)
        t = np.maximum.accumulate(window.t + delay) + 1e-6 * np.arange(len(delay))
        windows.append(replace(window, t=t, markers=markers))
    found = clean_recordings(replace(campaign, windows=tuple(windows))).recordings
    steps = [np.ptp(np.diff(window.t)) for window in found.campaign.windows]
    assert max(steps[1:]) < 1e-9
    assert len(found.notes) == 1
