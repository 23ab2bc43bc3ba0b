"""Cuts that the completed model does not need are taken back; hands that were there stay cut out."""

from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.data.records import Campaign, Robot, Role, Window
from fidim_lab.identification.markers.finding import DefectKind, Finding
from fidim_lab.identification.mle.fit import fit
from fidim_lab.identification.random_plan import random_plan
from fidim_lab.mismatch.cleaning.clean import Cleaned, clean
from fidim_lab.mismatch.cleaning.contacts import Contact, without
from fidim_lab.mismatch.cleaning.restored import restored, without_needless, without_needless_contacts
from fidim_lab.mismatch.explain import explain
from fidim_lab.mismatch.fitting.baseline import fit_baseline
from fidim_lab.mismatch.fitting.refit import Completed
from fidim_lab.mismatch.selection.select import select
from fidim_lab.model.mechanism import Mechanism
from sim_backends.plant.hidden import parse_effect
from sim_backends.plant.world import make_world
from sim_backends.simulate import Sampling, simulate_campaign

ATTACHMENT = "attachment-offset:cable=1,dx=0.003,dy=-0.002,dz=0.002"
HAND = "hand-contact:fx=1,fy=-1.5,start=3,stop=4,window=2"


def recorded(robot: Robot, *hidden: str) -> Campaign:
    plan = random_plan(robot, "short", 5, 1, 21)
    effects = tuple(parse_effect(text, robot.n) for text in hidden)
    world = make_world(robot, np.random.default_rng(21), effects)
    return simulate_campaign(robot, plan, world, np.random.default_rng(22), recording=Sampling(6.0))[0]


def hand(window: str, begin: float, end: float) -> Contact:
    return Contact(window, begin, end, 4.0, 0.25)


def cut(cleaned: Cleaned, *contacts: Contact) -> Cleaned:
    return replace(cleaned, campaign=without(cleaned.campaign, contacts), contacts=contacts)


@pytest.fixture(scope="module")
def touched(irma4: Robot) -> tuple[Cleaned, Completed]:
    """A campaign with a hand in i02 at a robot with a wrong attachment, and the completed model."""
    cleaned = clean(recorded(irma4, ATTACHMENT, HAND))
    audited = cut(cleaned, hand("i02", 2.8, 4.2), hand("i04", 2.0, 3.0))
    found = select(fit_baseline(audited.campaign, native=True, say=lambda _: None), lambda _: None)
    return cleaned, found.best.model


def test_a_contact_in_a_window_that_the_completed_fit_follows_like_all_others_is_not_told(irma4: Robot) -> None:
    cleaned = clean(recorded(irma4, HAND))
    true, false = hand("i02", 2.8, 4.2), hand("i04", 2.0, 3.0)
    audited = cut(cleaned, true, false)
    completed = fit(Mechanism(irma4, native=True), audited.campaign.of_role(Role.IDENTIFY))
    assert without_needless_contacts(cleaned, audited, completed).contacts == (true,)


@pytest.mark.slow
def test_a_contact_that_was_none_is_put_back_and_a_true_one_is_not(touched: tuple[Cleaned, Completed]) -> None:
    cleaned, model = touched
    true, false = hand("i02", 2.8, 4.2), hand("i04", 2.0, 3.0)
    kept = restored(cleaned, cut(cleaned, true, false), model)
    assert kept is not None
    assert kept.contacts == (true,)
    ids = [window.id for window in kept.campaign.windows]
    assert sorted(ids) == ["i01", "i02", "i02, part 2", "i03", "i04", "i05", "v01"]
    again = next(window for window in kept.campaign.windows if window.id == "i04")
    assert np.isfinite(again.markers).all()
    only = cut(cleaned, true)
    assert restored(cleaned, only, model) is None


@pytest.mark.slow
def test_of_two_contacts_in_a_window_the_needless_one_is_put_back(touched: tuple[Cleaned, Completed]) -> None:
    cleaned, model = touched
    kept = restored(cleaned, cut(cleaned, hand("i02", 1.2, 1.7), hand("i02", 2.8, 4.2)), model)
    assert kept is not None
    assert [contact.begin for contact in kept.contacts] == [2.8]


@pytest.mark.slow
def test_a_sample_that_is_off_stays_out_and_one_that_is_not_comes_back(touched: tuple[Cleaned, Completed]) -> None:
    cleaned, model = touched
    campaign = cleaned.campaign
    windows = {window.id: window for window in campaign.windows}
    markers = windows["i03"].markers.copy()
    markers[200, 0, 0] += 0.002
    spiky = replace(windows["i03"], markers=markers)
    before = replace(cleaned, campaign=_with(campaign, spiky))
    spikes = tuple(Finding(DefectKind.SPIKE, name, "x", (2.0, 2.0), 0.002, "m", "A spike.") for name in ("i03", "i05"))
    after = replace(
        before, campaign=_with(_with(campaign, _without_row(spiky)), _without_row(windows["i05"])), faults=spikes
    )
    kept = restored(before, after, model)
    assert kept is not None
    assert kept.faults == spikes[:1]
    lacking = {window.id for window in kept.campaign.windows if np.isnan(window.markers).any()}
    assert lacking == {"i03"}


@pytest.mark.slow
def test_screening_is_overruled_by_a_model_that_follows_the_samples(irma4: Robot) -> None:
    campaign = recorded(irma4)
    windows = {window.id: window for window in campaign.windows}
    markers = windows["i03"].markers.copy()
    markers[200, 0, 0] += 0.002
    seen = _with(campaign, replace(windows["i03"], markers=markers))
    model = fit_baseline(campaign, native=True, say=lambda _: None).as_it_is
    faults = tuple(Finding(DefectKind.SPIKE, name, "x", (2.0, 2.0), 0.002, "m", "A spike.") for name in ("i03", "i05"))
    screened = clean(campaign)
    lacking = _with(_with(campaign, _without_row(windows["i03"])), _without_row(windows["i05"]))
    cleaned = replace(screened, campaign=lacking, faults=faults)
    assert without_needless(seen, cleaned, model).faults == faults[:1]


@pytest.mark.slow
def test_a_hand_that_only_a_wrong_geometry_shows_is_none(touched: tuple[Cleaned, Completed]) -> None:
    cleaned, model = touched
    true, false = hand("i02", 2.8, 4.2), hand("i04", 2.0, 3.0)
    assert without_needless(cleaned.campaign, cut(cleaned, true, false), model).contacts == (true,)


@pytest.mark.slow
def test_a_hand_beside_a_wrong_attachment_is_named_with_it(irma4: Robot) -> None:
    explanation = explain(recorded(irma4, ATTACHMENT, HAND.replace("fx=1,fy=-1.5", "fx=4,fy=-4")), native=True)
    assert {(cause.id, cause.cable) for cause in explanation.effects} == {
        ("hand-contact", None),
        ("attachment-offset", 1),
    }


def _without_row(window: Window) -> Window:
    markers = window.markers.copy()
    markers[200] = np.nan
    return replace(window, markers=markers)


def _with(campaign: Campaign, window: Window) -> Campaign:
    return replace(campaign, windows=tuple(window if other.id == window.id else other for other in campaign.windows))
