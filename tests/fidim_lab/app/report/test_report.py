"""The report as a reader meets it: the numbers are there, nothing is loaded, nothing hostile gets through."""

import base64
import hashlib
import re
from dataclasses import replace
from html.parser import HTMLParser
from importlib.resources import files

import numpy as np
import pytest

from fidim_lab.app.report import report_command
from fidim_lab.app.report.drawings.svg import POINTS, points_for
from fidim_lab.app.report.pages.write import write_report
from fidim_lab.errors import FileError, RefusedError

OUR_SCRIPT = (files("fidim_lab.app.report.pages") / "script.js").read_text(encoding="utf-8")
VOID = {"meta", "path", "use", "line", "rect", "circle"}


class Reader(HTMLParser):
    """Tags, attributes and text of a page; complains about tags that do not close."""

    def __init__(self, page):
        super().__init__()
        self.open, self.tags, self.attributes, self.words = [], [], [], []
        self.feed(page)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data.strip())

    def values(self, name):
        return [value for key, value in self.attributes if key == name]


def page_of(folder, result):
    return write_report(folder, result).read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def full(campaign, write_folder, result_of):
    """The page of a run folder with everything in it."""
    return page_of(write_folder(campaign, journal=True, truth=True), result_of(campaign))


def test_the_numbers_are_there(full):
    words = Reader(full).words
    row = words[words.index("s_z") :]
    cells = [word for word in row if word][:10]
    # identified, sd, spread, %, CAD, true, error, error over the larger of sd and spread; mm
    assert cells == ["s_z", "193.20", "0.10", "0.30", "0.16", "190.00", "193.10", "+0.10", "+0.3", "I_xx"]
    assert "-73.30" in words  # s_z − a_z
    for shown in ("0.0871", "1.73", "3.25", "9", "1.07", "mind the gap"):
        assert any(shown in word for word in words), shown


def test_the_summary_says_what_was_recorded_found_and_known(full):
    text = " ".join(Reader(full).words)
    assert "2 windows of free motion (1 to identify from, 1 held out; 3.98 s in all) were recorded" in text
    assert "4 cables and 10.55 kg (1 marker at 100 Hz)" in text or "4 cables and" in text
    assert "193.20 ± 0.30) mm (CAD: 0, 0, 190)" in text
    assert "The windows agree within what noise explains" in text
    assert "9 of 9 parameters lie within twice the stated uncertainty" in text
    assert "1 further recording was rejected" in text


def test_the_run_is_told(full):
    text = " ".join(Reader(full).words)
    assert "amplitude is 0.004 m" in text
    assert "rejected/i01-attempt1.csv" in text
    assert "given up: skipped by the operator" in text
    assert "49–72 N" in text  # tensions at rest
    assert "All winches stand still, held." in text
    assert "air-drag-linear" in text


def test_nothing_is_loaded_and_only_our_script_runs(full):
    read = Reader(full)
    assert not re.search(r"https?:|//[a-z]|@import|javascript:", full)
    (script,) = re.findall(r"<script>(.*?)</script>", full, re.DOTALL)
    assert script == OUR_SCRIPT
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in " ".join(read.values("content"))
    assert not {"link", "img", "iframe", "object", "embed", "base", "form"} & set(read.tags)
    assert read.values("src") == []
    assert all(value.startswith("#") for value in read.values("href"))
    assert not [name for name, _ in read.attributes if name.startswith("on")]


def test_what_is_referred_to_is_there_once(full):
    ids = Reader(full).values("id")
    assert len(ids) == len(set(ids))
    referred = set(re.findall(r'(?:url\(|href=")#([^)"]+)', full))
    assert referred
    assert referred <= set(ids)


def test_every_picture_is_there_and_says_what_it_is(full):
    read = Reader(full)
    # windows; views of the robot; parameters, their correlations, validation, timeline
    assert read.tags.count("svg") == 2 * 4 + 4 + 4
    assert read.tags.count("figure") == read.tags.count("svg")
    assert all(read.values("aria-label"))


HOSTILE = "<script>alert('1')</script>&amp;<img src=x onerror=y> $\\frac$ {{ 7*7 }}"


def test_hostile_names_stay_text(campaign, write_folder, result_of):
    folder = write_folder(campaign)
    windows = tuple(replace(w, id=f"{w.id}{HOSTILE}") for w in campaign.windows)
    index = (folder / "campaign.toml").read_text()
    for window in campaign.windows:
        index = index.replace(f'id = "{window.id}"', f"id = '''{window.id}{HOSTILE}'''")
    (folder / "campaign.toml").write_text(index.replace('name = "made up"', f"name = '''{HOSTILE}'''"))
    result = result_of(replace(campaign, windows=windows), warnings=(HOSTILE,))
    notes = tuple(replace(verdict, notes=(HOSTILE,)) for verdict in result.windows)
    read = Reader(page_of(folder, replace(result, windows=notes)))
    assert read.tags.count("script") == 1
    assert "img" not in read.tags
    assert "onerror" not in dict(read.attributes)
    assert read.words.count(HOSTILE) == 1 + 1 + 2  # heading, warning, two notes
    assert f"i01{HOSTILE}" in read.words


def test_the_same_run_gives_the_same_bytes(full, campaign, write_folder, result_of):
    again = write_folder(campaign, journal=True, truth=True)
    assert page_of(again, result_of(campaign, seconds=2.0)) == full


@pytest.mark.usefixtures("undrawn")
def test_writing_it_again_changes_nothing(campaign, write_folder, result_of):
    folder = write_folder(campaign)
    (folder / "result.json").write_text("{}")
    first = page_of(folder, result_of(campaign))
    (folder / "result.json").write_text('{"seconds": 2}')
    assert page_of(folder, result_of(campaign)) == first
    assert "campaign.toml" in first
    assert "report.html" not in first
    assert "result.json" not in first


def without(**changes):
    return lambda campaign: replace(campaign, windows=tuple(replace(w, **changes) for w in campaign.windows))


def nine_markers(campaign):
    shape = np.random.default_rng(0).normal(scale=0.1, size=(8, 3))
    windows = tuple(replace(w, markers=w.markers + np.vstack([np.zeros(3), shape])) for w in campaign.windows)
    robot = replace(campaign.robot, marker=np.zeros(3), extra_markers=tuple(shape))
    return replace(campaign, robot=robot, windows=windows)


def load_cells(campaign):
    cells = {f"f{cable}": np.full(200, 30.0 + cable) for cable in range(1, 5)}
    return without(currents=None, further=cells)(campaign)


@pytest.mark.parametrize(
    ("change", "there", "absent"),
    [
        (without(currents=None), "Tensions from the model, since there are no motor currents", "Tensions from motor"),
        (without(lengths=None, currents=None), "Main marker from rest", "Tensions from motor"),
        (without(equilibrium=None), "Main marker from its mean", "from rest"),
        (without(), "No window was held out", "nowhere"),
        (nine_markers, "9 markers", "nowhere"),
        (load_cells, "Tensions from load cells", "motor currents"),
    ],
    ids=["no currents", "no lengths", "no rest", "none held out", "nine markers", "load cells"],
)
@pytest.mark.sampled(4)
def test_what_is_missing_is_left_out(campaign, write_folder, result_of, change, there, absent):
    changed = change(replace(campaign, windows=campaign.windows[:1]))
    text = " ".join(Reader(page_of(write_folder(changed), result_of(changed))).words)
    assert there in text
    assert absent not in text


@pytest.mark.usefixtures("undrawn")
def test_a_bare_campaign_has_no_columns_for_what_is_unknown(campaign, write_folder, result_of):
    words = Reader(page_of(write_folder(campaign), result_of(campaign, spread=None))).words
    assert not {"true", "error", "spread", "recordings", "Run", "Import", "re-fit"} & set(words)
    assert {"CAD", "paper, free", "paper, full"} <= set(words)  # the robot is theirs, and nothing says simulated
    assert "198.40" in words


@pytest.mark.usefixtures("undrawn")
def test_a_window_that_was_not_used_says_why(campaign, write_folder, result_of):
    result = result_of(campaign)
    bare = replace(
        result.windows[1], used=False, variant=None, sigma_perp=None, rms_mm=None, chi2_per_dof=None, conditioning=None,
        notes=("no sample is left",), residual=None, prediction=None,
    )  # fmt: skip
    words = Reader(page_of(write_folder(campaign), replace(result, windows=(result.windows[0], bare)))).words
    assert "no sample is left" in words
    assert "✗ not used" in words


def test_a_method_without_equations_needs_none(campaign, write_folder, result_of):
    """Trajectory-level estimators have no σ_W, no C and no ε."""
    result = result_of(campaign, sigma_W=None, C=None, noise_ratio=None)
    windows = tuple(replace(verdict, residual=None) for verdict in result.windows)
    text = " ".join(Reader(page_of(write_folder(campaign), replace(result, windows=windows))).words)
    assert "Δ = recorded − model" in text
    assert "ε" not in text
    assert "expected σ⊥" not in text


@pytest.mark.parametrize("windows", [24, 60])
@pytest.mark.sampled(1)
def test_it_stays_small(campaign, write_folder, result_of, monkeypatch, windows):
    """Windows of 10 s with noisy currents, from the growth by one window drawn as finely as so many would be."""
    for module in ("pages.page", "drawings.scene", "drawings.solid"):
        monkeypatch.setattr(
            f"fidim_lab.app.report.{module}.points_for", lambda drawn, most=POINTS: points_for(windows, most)
        )
    rng = np.random.default_rng(2)
    t = np.arange(0, 10.01, 0.01)
    window = replace(
        campaign.windows[0], t=t, markers=rng.normal(size=(len(t), 1, 3)), currents=rng.normal(size=(len(t), 4)),
        lengths=np.tile(campaign.windows[0].lengths[0], (len(t), 1)),
    )  # fmt: skip
    sizes = []
    for count in (1, 2):
        grown = replace(campaign, windows=tuple(replace(window, id=f"i{k}") for k in range(count)))
        sizes.append(len(page_of(write_folder(grown), result_of(grown)).encode()))
    assert sizes[0] + (windows - 1) * (sizes[1] - sizes[0]) < 3e6


@pytest.mark.usefixtures("undrawn")
def test_a_run_without_a_window_is_told_too(campaign, write_folder, journal_at):
    folder = write_folder(replace(campaign, windows=()))
    journal_at(folder / "journal.jsonl").begin("i01").start("MoveTo")
    text = " ".join(Reader(page_of(folder, None)).words)
    assert "No window was recorded" in text
    assert "The run ended before the first window was accepted." in text
    assert "the run was interrupted" in text
    assert "the run ended before these were accepted: i01" in text


@pytest.mark.usefixtures("undrawn")
def test_a_refusal_is_told(campaign, write_folder, monkeypatch):
    def refuse(folder):
        raise RefusedError("The windows do not identify a body <at all>.")

    monkeypatch.setattr("fidim_lab.app.workflows.identify.run_identify", refuse)
    read = Reader(page_of(write_folder(campaign), None))
    assert "The windows do not identify a body <at all>." in read.words
    assert "✗ nothing identified" in read.words


@pytest.mark.usefixtures("undrawn")
def test_an_import_is_told(campaign, write_folder, result_of):
    folder = write_folder(campaign)
    (folder / "import.json").write_text(
        """{"format": "fidim-import/1", "kind": "irma4u", "name": "FreeMotion02", "sources": {"log": "a/b.mat"},
        "cluster": {"noise": 2e-4, "rms": 1.7e-4, "frames_used": 5672, "frames": 5676, "markers": []},
        "registration": {"rms": 4.7e-4, "compliance": 2.4e-5, "tilt": 0.03}, "too_short": [],
        "clock": {"log_minus_markers": {"offset": -0.0151, "sd": 0.0019}},
        "windows": [{"id": "i01", "t": [9.17, 11.78], "says": "before it a hand adds energy"}]}"""
    )
    text = " ".join(Reader(page_of(folder, result_of(campaign))).words)
    assert "Imported as irma4u: FreeMotion02" in text
    assert "-0.0151 ± 0.0019 s" in text
    assert "Cut out from 9.17 to 11.78 s: before it a hand adds energy" in text


@pytest.mark.usefixtures("undrawn")
def test_mistakes_name_the_file(campaign, write_folder, result_of, tmp_path):
    with pytest.raises(FileError, match="no such folder"):
        write_report(tmp_path / "nowhere")
    folder = write_folder(campaign, truth=True)
    with pytest.raises(FileError, match="cannot be written"):
        write_report(folder, result_of(campaign), tmp_path / "no" / "such" / "folder.html")
    (folder / "truth.json").write_text('{"s": [0, 0], "I": [1, 1, 1, 0, 0, 0]}')
    with pytest.raises(FileError, match=r"truth\.json: s"):
        write_report(folder, result_of(campaign))
    (folder / "truth.json").write_text("{\n,")
    with pytest.raises(FileError, match=r"truth\.json: line 2"):
        write_report(folder, result_of(campaign))


@pytest.mark.shared
@pytest.mark.slow
def test_a_recorded_campaign_gets_its_report(shared, tmp_path, monkeypatch, capsys):
    from fidim_lab.app.workflows.identify import run_identify

    monkeypatch.setattr(
        "fidim_lab.app.workflows.identify.run_identify", lambda folder: run_identify(folder, predict=False)
    )
    out = tmp_path / "two.html"
    assert report_command(shared / "campaigns" / "open-two-at-once", out) == 0
    assert str(out) in capsys.readouterr().out
    page = out.read_text(encoding="utf-8")
    assert len(page.encode()) < 3e6
    assert Reader(page).tags.count("svg") == 18 * 3 + 12 + 4 + 3  # spectra of the fitted windows, which are simulated
