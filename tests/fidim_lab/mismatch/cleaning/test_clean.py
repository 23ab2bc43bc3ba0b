"""What is cut out before physics is named: hands with their times, faults of sensors; and what must not be cut out."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fidim_lab.data.records import Campaign, Robot
from fidim_lab.errors import RefusedError
from fidim_lab.identification.cleaning.clean import Screened
from fidim_lab.identification.cleaning.free_motion import WHY
from fidim_lab.identification.cleaning.removed import Removed
from fidim_lab.identification.markers.finding import DefectKind, Finding
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.cleaning import clean as clean_module
from fidim_lab.mismatch.cleaning.clean import Cleaned, clean
from fidim_lab.mismatch.cleaning.contacts import Contact, find_contacts, without
from fidim_lab.mismatch.cleaning.residual_checks import audit
from fidim_lab.mismatch.cleaning.segments import Segmented, Segments
from fidim_lab.mismatch.conclusion.explanation import Explanation, Verdict
from fidim_lab.mismatch.conclusion.merge_cleaning import with_cleaning
from fidim_lab.mismatch.conclusion.parts import Before
from fidim_lab.mismatch.fitting.baseline import fit_baseline
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign


@pytest.fixture(scope="module")
def recorded(irma4: Robot):
    @cache
    def make(*hidden: str, seed: int = 21, duration: float = 6.0) -> Campaign:
        plan = random_plan(irma4, "short", 3, 1, seed)
        effects = tuple(parse_effect(text, irma4.n) for text in hidden)
        world = make_world(irma4, np.random.default_rng(seed), effects)
        return simulate_campaign(irma4, plan, world, np.random.default_rng(seed + 1), recording=Sampling(duration))[0]

    return make


def audited(campaign: Campaign) -> tuple[Cleaned, Cleaned]:
    cleaned = clean(campaign)
    return cleaned, audit(cleaned, fit_baseline(cleaned.campaign, native=True, say=lambda _: None)) or cleaned


def test_a_null_is_left_alone(recorded) -> None:
    cleaned, after = audited(recorded())
    assert after is cleaned
    assert not after.faults
    assert not after.contacts


def test_a_second_hand_in_what_the_first_one_left_is_of_the_whole_window(
    recorded, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaign = recorded()
    really = clean_module.clean_recordings

    def with_two_hands(campaign: Campaign, *, kinematics: bool = False) -> Screened:
        seen = really(campaign, kinematics=kinematics)
        two = (Removed("i02", (1.0, 2.0), WHY, 100), Removed("i02, part 2", (3.0, 3.5), WHY, 50))
        return replace(seen, recordings=replace(seen.recordings, removed=two))

    monkeypatch.setattr(clean_module, "clean_recordings", with_two_hands)
    found = clean(campaign).contacts
    assert [(one.window, one.begin, one.end) for one in found] == [("i02", 1.0, 2.0), ("i02", 3.0, 3.5)]


@pytest.mark.slow
@pytest.mark.parametrize("force", ["fx=1,fy=-1.5", "fx=-4,fy=1"])
def test_a_hand_is_found_with_its_window_and_times(recorded, force: str) -> None:
    _, after = audited(recorded(f"hand-contact:{force},start=3,stop=4,window=2"))
    assert [contact.window for contact in after.contacts] == ["i02"]
    contact = after.contacts[0]
    assert contact.begin == pytest.approx(3.0, abs=0.35)
    assert contact.end == pytest.approx(4.0, abs=0.35)
    inside = (contact.begin + 0.05, contact.end - 0.05)
    for window in after.campaign.windows:
        if window.id.startswith("i02"):
            here = (window.t > inside[0]) & (window.t < inside[1])
            assert np.isnan(window.markers[here]).all()
    assert {"i02", "i02, part 2"} <= {window.id for window in after.campaign.windows}


@pytest.mark.slow
def test_a_soft_hand_at_the_same_time_of_every_window_is_found_by_all_of_them(recorded) -> None:
    """Too soft to stand out in all of them: at 2.3 to 3.5 s of each."""
    cleaned, after = audited(recorded("hand-contact:fx=0.4,fy=-0.32,start=2.3,stop=3.5,window=0", duration=8.0))
    assert {contact.window for contact in after.contacts} == {window.id for window in cleaned.campaign.windows}
    for contact in after.contacts:
        assert contact.begin < 2.3
        assert contact.end > 3.5
        assert contact.end - contact.begin < 2.5


@pytest.mark.slow
def test_a_hand_on_a_held_out_window_alone_is_found(recorded) -> None:
    _, after = audited(recorded("hand-contact:fx=1,fy=-1.5,start=3,stop=4,window=3"))
    assert [contact.window for contact in after.contacts] == ["v01"]
    assert not after.faults


@pytest.mark.slow
@pytest.mark.parametrize(
    "hidden",
    [
        "loose-mass:m=0.6,f=8",
        "attachment-friction:dry=0.1,viscous=0",
        "frame-sway:f=5",
        "cable-creep:delta=0.006",
        "periodic-force:f=6,ax=1",
        "swivel-friction:c=0.05",
        "unknown-cubic:c=25",
    ],
)
def test_physics_is_no_hand_and_no_fault(recorded, hidden: str) -> None:
    _, after = audited(recorded(hidden))
    assert not after.contacts
    assert not after.faults


@pytest.mark.slow
@pytest.mark.parametrize("slipped", ["i02", "v01"])
def test_a_slipped_encoder_of_one_window_is_named(recorded, slipped: str) -> None:
    campaign = recorded(seed=23)
    windows = list(campaign.windows)
    k = [window.id for window in windows].index(slipped)
    lengths = windows[k].lengths.copy()
    lengths[:, 2] += 1e-3
    windows[k] = replace(windows[k], lengths=lengths)
    _, after = audited(replace(campaign, windows=tuple(windows)))
    assert [(fault.window, fault.channel) for fault in after.faults] == [(slipped, "l3")]


@pytest.mark.slow
def test_a_jump_that_a_frozen_run_hides_is_a_fault_up_to_the_end(recorded) -> None:
    campaign = recorded()
    window = campaign.windows[1]
    markers = window.markers.copy()
    markers[270:300] = markers[269]
    markers[300:, :, 0] += 0.012
    windows = (campaign.windows[0], replace(window, markers=markers), *campaign.windows[2:])
    _, after = audited(replace(campaign, windows=windows))
    assert not after.contacts
    assert {(fault.kind, fault.window) for fault in after.faults} >= {
        (DefectKind.FROZEN, "i02"),
        (DefectKind.JUMP, "i02"),
    }
    kept = after.campaign.windows[1]
    assert np.isnan(kept.markers[kept.t > 3.0]).all()


def test_parts_of_a_window_keep_clock_and_lengths(recorded) -> None:
    campaign = recorded()
    window = campaign.windows[0]
    cut = without(campaign, [Contact(window.id, 2.0, 3.0, 10.0, 0.1)])
    first, second = cut.windows[:2]
    assert (first.id, second.id) == (window.id, f"{window.id}, part 2")
    for part, here in ((first, window.t < 2.0), (second, window.t > 3.0)):
        assert np.array_equal(part.t, window.t)
        assert np.array_equal(part.lengths, window.lengths)
        assert np.array_equal(np.isfinite(part.markers).all(axis=(1, 2)), here)
    assert len(cut.windows) == len(campaign.windows) + 1


def test_a_robot_file_with_swapped_cables_is_refused_with_that_reason(recorded) -> None:
    campaign = recorded()
    first, second, *rest = campaign.robot.cables
    swapped = replace(campaign, robot=replace(campaign.robot, cables=(second, first, *rest)))
    with pytest.raises(RefusedError, match="Cables 1 and 2 are swapped"):
        clean(swapped)


def test_gravity_that_points_up_is_refused_with_that_reason(recorded) -> None:
    campaign = recorded()
    with pytest.raises(RefusedError, match=r"gravity \[-?0.0, -?0.0, 9.81\] m/s² goes"):
        clean(replace(campaign, robot=replace(campaign.robot, gravity=-campaign.robot.gravity)))


@pytest.mark.parametrize("scatter", [1e-4, 0.01])
@pytest.mark.sampled(1)
def test_markers_that_only_scatter_are_refused(recorded, scatter: float) -> None:
    """Noise about one place, as small as declared and far larger; one window that swings is enough to go on."""
    campaign = recorded()
    rng = np.random.default_rng(5)
    still = tuple(
        replace(window, markers=window.markers[100] + rng.normal(0.0, scatter, window.markers.shape))
        for window in campaign.windows
    )
    with pytest.raises(RefusedError, match="Nothing swings"):
        clean(replace(campaign, windows=still))
    assert clean(replace(campaign, windows=(campaign.windows[0], *still[1:]))).campaign.windows


def explanation(verdict: Verdict) -> Explanation:
    return Explanation("c", verdict, (), (), Before(1, 1), Before(1, 1), (), {}, {}, None, "As said.", 1.0)


def test_verdicts_after_cleaning(recorded) -> None:
    cleaned = clean(recorded())
    fault = Finding(DefectKind.SPIKE, "i01", "x", (1.0, 1.0), 0.01, "m", "Window i01: a spike.")
    faulty = replace(cleaned, faults=(fault,))
    touched = replace(faulty, contacts=(Contact("i02", 1.0, 2.0, 9.0, 0.2), Contact("i02", 4.0, 5.0, 9.0, 0.2)))
    assert with_cleaning(explanation(Verdict.NOTHING_MISSING), cleaned).verdict is Verdict.NOTHING_MISSING
    only = with_cleaning(explanation(Verdict.NOTHING_MISSING), faulty)
    assert (only.verdict, only.effects) == (Verdict.SENSOR_FAULT, ())
    assert "a spike" in only.message
    physics = with_cleaning(explanation(Verdict.EXPLAINED), faulty)
    assert physics.verdict is Verdict.EXPLAINED
    assert "a spike" in physics.message
    hand = with_cleaning(explanation(Verdict.NOTHING_MISSING), touched)
    assert hand.verdict is Verdict.EXPLAINED
    assert [effect.id for effect in hand.effects] == ["hand-contact"]
    assert {name: p.value for name, p in hand.effects[0].parameters.items()} == {
        "i02 begin 1": 1.0,
        "i02 end 1": 2.0,
        "i02 begin 2": 4.0,
        "i02 end 2": 5.0,
    }
    assert with_cleaning(explanation(Verdict.UNKNOWN_PHYSICS), touched).verdict is Verdict.PARTLY_EXPLAINED


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    ("faults", "contradicted", "verdict"),
    [
        (3, True, Verdict.SENSOR_FAULT),
        (2, True, Verdict.UNKNOWN_PHYSICS),  # may be chance beside wrong geometry
        (3, False, Verdict.UNKNOWN_PHYSICS),  # a force may be at work
    ],
)
def test_what_has_no_name_and_no_force_does_is_put_down_to_sensors_that_are_known_to_be_faulty(
    recorded, faults: int, contradicted: bool, verdict: Verdict
) -> None:
    cleaned = clean(recorded())
    spikes = [
        Finding(DefectKind.SPIKE, "i01", "x", (t, t), 0.01, "m", "Window i01: a spike.") for t in range(1, faults + 1)
    ]
    redundancy = tuple(replace(one, contradicts=contradicted) for one in cleaned.screening.redundancy)
    screening = replace(cleaned.screening, redundancy=redundancy)
    told = with_cleaning(
        explanation(Verdict.UNKNOWN_PHYSICS), replace(cleaned, screening=screening, faults=tuple(spikes))
    )
    assert told.verdict is verdict
    assert ("Sensors are at fault" in told.message) == (verdict is Verdict.SENSOR_FAULT)


PUSHED = [1.01, 1.6, 0.99, 1.0]


@pytest.mark.parametrize(
    ("chi2", "expected"),
    [
        (PUSHED, (1.5, 3.0)),
        (PUSHED[::-1], (3.0, 4.5)),
        ([1.6, 1.01, 0.99, 1.0], None),  # how every motion begins
        ([1.3, 1.6, 1.3, 1.2], None),  # physics that is at work all the time
        ([2.0, 2.9, 2.0, 2.0], None),  # the same, a little more in the middle
        ([1.0, 1.5, 1.0, 1.5], None),
        ([1.0, 1.02, 1.01, 1.0], None),
    ],
)
@pytest.mark.sampled(3)
def test_windows_pooled_show_what_none_of_them_does(recorded, chi2, expected) -> None:
    edges = np.linspace(0.0, 6.0, 5)
    noise = np.random.default_rng(1)
    pooled = tuple(
        Segmented(window, edges, np.array(chi2) + 0.05 * noise.normal(size=4), np.full(4, 400.0))
        for window in recorded().windows
    )
    found = find_contacts(Segments(pooled, None))  # type: ignore[arg-type]
    assert {(contact.begin, contact.end) for contact in found} == ({expected} if expected else set())
