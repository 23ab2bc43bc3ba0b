"""What was left out and the proof: the page, the section in a report, and whether the numbers reproduce the claim."""

import re
from dataclasses import replace

import numpy as np
import pytest

from fidim_lab.app.formats.explanation_file import as_file, claims_of, read_explanation
from fidim_lab.app.formats.explanation_parts import EffectTable
from fidim_lab.app.report.contents.found_model import named_effect
from fidim_lab.app.report.contents.proof import proof
from fidim_lab.app.report.drawings import spectra
from fidim_lab.app.report.drawings.figures import sd_levels
from fidim_lab.app.report.pages.explain_page import write_explain_page
from fidim_lab.app.report.pages.write import write_report
from fidim_lab.app.report.sections.explained import effect_tables, explained
from fidim_lab.app.report.sections.proof_figures import field_drawings
from fidim_lab.app.report.sections.words import explained_sentence
from fidim_lab.data.records import PARAMETER_NAMES, Campaign, Robot, Role, Window
from fidim_lab.effects.catalogue import by_id, catalogue
from fidim_lab.errors import FileError
from fidim_lab.identification.mle.fit import Fit
from fidim_lab.identification.results.result import Geometry, Moved
from fidim_lab.mismatch.conclusion.explanation import (
    BodyParameter,
    Explanation,
    MismatchPlace,
    NamedCause,
    Verdict,
    write_explanation,
)
from fidim_lab.mismatch.conclusion.parts import Before, EffectParameter, HeldOutFigures, Ranked
from fidim_lab.mismatch.fitting.holdout import HeldOut
from fidim_lab.mismatch.residuals.channels import Channel
from fidim_lab.mismatch.unknown_force.family import Dependence
from fidim_lab.mismatch.unknown_force.field import Field
from fidim_lab.mismatch.unknown_force.unknown import FamilyTried, Term, UnknownForce
from fidim_lab.model.equilibria import equilibrium_at
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.motion import simulate_free_motion

DRAG = 6.0
"""N s/m: what is hidden"""


@pytest.fixture(scope="module")
def dragged(irma4):
    """A held-out window of the nominal body with air drag, and one to identify from."""
    (effect,) = by_id(irma4, "air-drag-linear")
    mechanism = Mechanism(irma4, (effect,), [DRAG])
    rest = equilibrium_at(mechanism, irma4.nominal, np.array([1.2, -0.2, -0.3]))
    t = np.arange(0, 4.0, 0.01)
    xi = mechanism.structure_matrix(rest.pose.position[None], rest.pose.rotation[None])[0]
    free = np.linalg.svd(xi)[2][4:]  # twists that leave the lengths as they are
    motion = simulate_free_motion(mechanism, irma4.nominal, rest.pose, 1.0 * free.sum(axis=0), t).motion
    marker = motion.positions + motion.rotations @ irma4.marker
    lengths = np.tile(rest.lengths, (len(t), 1))
    rng = np.random.default_rng(5)
    noisy = marker[:, None] + irma4.sensors.marker_noise * rng.normal(size=(len(t), 1, 3))
    window = Window("v01", Role.VALIDATE, t, noisy, lengths=lengths, currents=None)
    return Campaign("with drag", irma4, 100.0, (replace(window, id="i01", role=Role.IDENTIFY), window))


@pytest.fixture
def explanation(irma4):
    body = {
        name: BodyParameter(float(value), 1e-5, float(value))
        for name, value in zip(PARAMETER_NAMES, irma4.nominal.vector, strict=True)
    }
    moved = {**body, "s_x": replace(body["s_x"], value=body["s_x"].value - 2e-4)}
    cause = NamedCause(
        "air-drag-linear", None, ("rotational-drag",), {"c": EffectParameter(DRAG, 0.01, "N s/m")}, "F = −c v"
    )
    return Explanation(
        campaign="with drag", verdict=Verdict.EXPLAINED, effects=(cause,),
        where=(MismatchPlace("i01", (0.5, 2.0), "x", 1.3, 0.6, "Window i01 is off in x <most>."),),
        chi2_per_dof=Before(41.0, 1.02), rms_mm=Before(0.66, 0.101),
        ranking=(Ranked(("air-drag-linear",), 1.02, True, "accepted: white"),
                 Ranked(("pulley-radius",), 38.0, False, "a pulley of 3 m")),
        parameters=body, parameters_before=moved, next_experiment="Repeat it by night.",
        message="Left out: air-drag-linear. Chance of a false alarm: 0 of 10000 draws.", seconds=3.0,
        untested=("loose-mass",),
    )  # fmt: skip


def words_of(page):
    return " ".join(re.sub(r"<(style|script|svg).*?</\1>|<[^>]*>", " ", page, flags=re.DOTALL).split())


def test_the_stated_numbers_reproduce_the_improvement(dragged, explanation):
    shown = proof(as_file(explanation), dragged)
    (one,) = shown.windows
    assert one.window.id == "v01"
    assert one.after.chi2_per_dof == pytest.approx(1.0, abs=0.15)
    assert one.before.chi2_per_dof > 5 * one.after.chi2_per_dof
    assert np.sqrt(np.nanmean(one.after.residuals**2)) == pytest.approx(dragged.robot.sensors.marker_noise, rel=0.1)
    assert shown.notes == ()


def test_figures_say_of_which_windows_they_are_and_each_channel_what_it_shows(dragged, explanation):
    others = HeldOutFigures(Before(44.0, 1.04), Before(0.68, 0.102))
    lengths = Channel("lengths", white=False, p=2e-9, trend_over_windows=None)
    found = as_file(replace(explanation, left_out=others, channels=(lengths,)))
    figures, channels, _ = explained(found, proof(found, dragged), 1e-4).before_after
    assert figures.rows == (
        ("each window by the others", "χ²/dof", "44", "1.04", "99.9 %"),
        ("each window by the others", "rms, mm", "0.68", "0.102", "–"),
        ("held-out windows", "χ²/dof", "41", "1.02", "99.9 %"),
        ("held-out windows", "rms, mm", "0.66", "0.101", "–"),
    )
    assert channels.rows == (("lengths", "more than noise", "2e-09", "–"),)


def test_the_geometry_that_was_found_is_part_of_what_predicts(dragged, explanation):
    moved = Moved("anchor", 1, (0.0, 0.0, 0.004), (1e-4,) * 3)
    here = proof(as_file(explanation), dragged).windows[0]
    elsewhere = proof(as_file(replace(explanation, geometry=Geometry(50.0, (moved,)))), dragged).windows[0]
    assert elsewhere.before.chi2_per_dof == pytest.approx(here.before.chi2_per_dof)
    assert elsewhere.after.chi2_per_dof > 1.5 * here.after.chi2_per_dof
    alone = proof(as_file(replace(explanation, effects=(), geometry=Geometry(50.0, (moved,)))), dragged).windows[0]
    named = NamedCause(
        "anchor-offset",
        1,
        (),
        {f"d{x}": EffectParameter(by, 1e-4, "m") for x, by in zip("xyz", moved.by, strict=True)},
        "",
    )
    once = proof(as_file(replace(explanation, effects=(named,), geometry=Geometry(50.0, (moved,)))), dragged).windows[0]
    assert once.after.chi2_per_dof == pytest.approx(alone.after.chi2_per_dof), "the piece that is named counts once"


@pytest.mark.slow
def test_numbers_that_do_not_hold_are_seen_not_to(dragged, explanation):
    (cause,) = explanation.effects
    wrong = replace(cause, parameters={"c": EffectParameter(0.2 * DRAG, 0.01, "N s/m")})
    (one,) = proof(as_file(replace(explanation, effects=(wrong,))), dragged).windows
    assert one.after.chi2_per_dof > 3


def test_an_effect_that_nobody_knows_leaves_a_note(dragged, explanation):
    (cause,) = explanation.effects
    strange = as_file(replace(explanation, effects=(replace(cause, parameters={"zeal": cause.parameters["c"]}),)))
    shown = proof(strange, dragged)
    assert shown.windows[0].after is None
    assert "no variant with the parameters zeal" in " ".join(shown.notes)
    section = explained(strange, shown, 1e-4)
    assert len(section.drawings) == 3


def test_windows_with_a_hand_in_them_prove_nothing(dragged, explanation):
    hand = NamedCause("hand-contact", None, (), {"v01 begin": EffectParameter(1.0, 0.1, "s")}, "a hand")
    assert proof(as_file(replace(explanation, effects=(hand,))), dragged).windows == ()


def test_the_page_says_what_was_found_and_why(dragged, explanation, write_folder, tmp_path):
    pictures = tmp_path / "pictures"
    path = write_explain_page(write_folder(dragged), explanation, tmp_path / "why.html", pictures)
    page = path.read_text(encoding="utf-8")
    words = words_of(page)
    for said in (
        "✓ explained", "air-drag-linear: F = −c v; these data cannot separate it from rotational-drag", "0.01 N s/m",
        "Window i01 is off in x &lt;most&gt;.", "χ²/dof 41 1.02", "Repeat it by night.",
        "✗ impossible a pulley of 3 m", "0 of 10000 draws", "loose-mass this version cannot test it", "SHA-256",
    ):  # fmt: skip
        assert said in words, said
    assert "+20.0" in words  # s_x moved by 0.2 mm, 20 sd
    names = sorted(one.name for one in pictures.iterdir())
    assert names == ["01-shifts.svg", "02-spectra.svg", "03-residuals.svg", "04-robot.svg"]
    assert all('xmlns="http://www.w3.org/2000/svg"' in one.read_text() for one in pictures.iterdir())
    assert page.count("<svg") == 4


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_a_reports_section_comes_from_the_file(dragged, explanation, write_folder, result_of):
    folder = write_folder(dragged)
    assert "What was left out" not in write_report(folder, result_of(dragged)).read_text()
    write_explanation(folder / "explanation.json", explanation)
    words = words_of(write_report(folder, result_of(dragged)).read_text())
    assert "Repeat it by night." in words
    said = "fidim explain names what is missing, air-drag-linear: held-out χ²/dof changes from 41 to 1.02. With it"
    summary = words[: words.index("Parameters")]
    assert summary.index("Found " + said) < summary.index("Without it The centre of mass")  # the body to believe leads
    write_explanation(folder / "explanation.json", replace(explanation, verdict=Verdict.NOTHING_MISSING))
    words = words_of(write_report(folder, result_of(dragged)).read_text())
    assert words.index("Found The centre of mass") < words.index("Left out fidim explain finds nothing missing")


@pytest.mark.parametrize(
    ("verdict", "says"),
    [
        (Verdict.NOTHING_MISSING, "nothing missing"),
        (Verdict.PARTLY_EXPLAINED, "what is missing, air-drag-linear: held-out χ²/dof changes from 41 to 1.02"),
        (Verdict.UNKNOWN_PHYSICS, "not in its catalogue"),
        (Verdict.SENSOR_FAULT, "a fault of a sensor"),
    ],
)
def test_the_summary_tells_what_became_of_the_explanation(explanation, verdict, says):
    assert says in explained_sentence(as_file(replace(explanation, verdict=verdict)))


def test_a_large_class_is_told_whole_and_the_file_keeps_to_its_format(explanation):
    """At most three in `equivalent_to`, by spec/formats.md; a fourth is no less possible."""
    alike = ("rotational-drag", "swivel-damping", "umbilical", "pulley-friction")
    large = replace(explanation, effects=(replace(explanation.effects[0], equivalent_to=alike),))
    assert large.table["effects"][0]["equivalent_to"] == list(alike[:3])
    assert large.table["effects"][0]["further_equivalent"] == ["pulley-friction"]
    read = as_file(large)
    assert read.effects[0].alike == alike
    assert claims_of(read)[0].rivals == alike
    assert "these data cannot separate it from rotational-drag, swivel-damping, umbilical, pulley-friction" in str(
        effect_tables(read)[0]
    )


def test_several_effects_are_listed_and_the_centre_of_mass_has_its_interval(explanation):
    second = replace(explanation.effects[0], id="clock-rate", equivalent_to=())
    third = replace(second, id="anchor-offset", cable=2)
    said = explained_sentence(as_file(replace(explanation, effects=(*explanation.effects, second, third))))
    assert "air-drag-linear, clock-rate and anchor-offset (cable 2): held-out" in said
    assert "190.000 ± 0.010) mm from P" in said


@pytest.mark.parametrize(
    ("low", "high", "ticks"),
    [
        (-5.3, 2.3, [-5, -2, 0, 2]),
        (0.0, 1.0, [0]),
        (-300.0, 30.0, [-100, -10, -2, 0, 2, 10]),
    ],
)
def test_ticks_of_the_shifts_lie_where_the_bars_are(low, high, ticks):
    assert sd_levels(low, high) == ticks


def test_a_wrong_file_names_the_key(explanation, tmp_path):
    path = tmp_path / "explanation.json"
    write_explanation(path, explanation)
    assert read_explanation(path) == as_file(explanation)
    path.write_text(path.read_text().replace('"explained"', '"certain"'))
    with pytest.raises(FileError, match=r"explanation\.json: verdict"):
        read_explanation(path)


def test_a_sine_has_its_amplitude_and_noise_its_level():
    t = np.arange(0, 10, 0.01)
    found = spectra.amplitudes("x", t, 3e-3 * np.sin(2 * np.pi * 2.0 * t)[:, None])
    k = int(np.argmax(found.amplitudes))
    assert found.frequencies[k] == pytest.approx(2.0)
    assert found.amplitudes[k] == pytest.approx(3e-3, rel=0.01)
    noise = spectra.amplitudes("x", t, 1e-4 * np.random.default_rng(1).normal(size=(1000, 3)))
    level = float(np.sqrt(np.mean(noise.amplitudes[2:] ** 2)))
    assert level == pytest.approx(spectra.noise_level(1e-4, 1000, 3), rel=0.1)


def test_gaps_do_not_shift_a_line_and_few_samples_have_no_spectrum():
    t = np.arange(0, 10, 0.01)
    values = np.sin(2 * np.pi * 3.0 * t)[:, None]
    values[200:260] = np.nan
    found = spectra.amplitudes("x", t, values)
    assert found.frequencies[int(np.argmax(found.amplitudes))] == pytest.approx(3.0, abs=0.1)
    assert spectra.amplitudes("x", t[:20], values[:20]) is None


@pytest.fixture
def unknown():
    """A wrench without a name that pushes along x, ever harder, with everything that a report tells of it."""
    count = 2000
    columns = np.outer(np.linspace(0.0, 1.0, count), [1.0, 0.5, 0.0])
    field = Field(
        ("i01",) * count, np.linspace(0.0, 4.0, count), columns, columns + 0.1, columns, columns, 3 * columns,
        np.zeros((count, 3)),
    )  # fmt: skip
    term = Term("force by place", Dependence.POSITION, None, None, (0.0, 0.0, 0.0), ("It pushes towards x.",), True)
    before, after = HeldOut(4000.0, 1000, 1e-3, {}), HeldOut(1100.0, 1000, 1e-4, {})
    tried = (FamilyTried("force by place", 0.93, 0.9, 812.0), FamilyTried("force by time", 0.1, float("nan"), 2.0))
    return UnknownForce(
        (term,), 0.93, before, after, term.words, field, (), tried, fit=Fit.__new__(Fit), seconds=1.0
    )  # fmt: skip


@pytest.mark.usefixtures("undrawn")
def test_a_reports_section_tells_of_what_has_no_name_from_the_file(
    dragged, explanation, unknown, write_folder, result_of
):
    folder = write_folder(dragged)
    whole = replace(explanation, verdict=Verdict.UNKNOWN_PHYSICS, effects=(), unknown=unknown)
    write_explanation(folder / "explanation.json", whole)
    words = words_of(write_report(folder, result_of(dragged)).read_text())
    for said in ("It pushes towards x.", "force by place 93 % 90 % 812", "force by time 10 % – 2"):
        assert said in words, said


def test_the_wrench_along_the_motion_is_drawn_as_it_was_stored(explanation, unknown, tmp_path):
    path = tmp_path / "explanation.json"
    write_explanation(path, replace(explanation, unknown=unknown))
    found = read_explanation(path).unknown.field.field
    assert 400 <= len(found.t) <= 600  # enough for a picture, few enough for a file
    thinned = unknown.field.thinned(600)
    for name in ("t", "places", "centres", "velocities", "spins", "forces", "torques"):
        np.testing.assert_allclose(getattr(found, name), getattr(thinned, name), atol=1e-4 * 4)
    assert found.windows == thinned.windows
    longest = re.findall(r"longest arrow is ([\d.]+) N", " ".join(d.caption for d in field_drawings(found)))
    assert float(longest[0]) == pytest.approx(3 * np.sqrt(1.25), rel=0.02)


def test_every_variant_of_every_effect_is_drawn_as_itself(irma4: Robot):
    robot = replace(irma4, extra_markers=(np.array([0.1, 0.0, 0.0]),))
    for effect in (one for one in catalogue(robot) if one.parameters):
        told = {p.name: EffectParameter(value=0.0, unit=p.unit) for p in effect.parameters}
        table = EffectTable(id=effect.id, cable=effect.cable, parameters=told, says=effect.says)
        drawn = named_effect(table, robot)
        assert type(drawn) is type(effect), table
