"""The Python interface: defaults and, to the bit, answers of the commands; results that show themselves."""

import inspect
import json
import runpy
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import fidim_lab as fl
from fidim_lab.api.as_command import OTHER_NAMES, as_command, in_python
from fidim_lab.app import cli
from fidim_lab.data.records import PARAMETER_NAMES

ROOT = Path(__file__).parents[2]
HIDDEN = "air-drag-linear:c=0.01"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small campaign, as the command writes it."""
    path = tmp_path_factory.mktemp("interface") / "small"
    assert cli.run(["simulate", *_small(path)]) == 0
    return path


def _small(path: Path) -> list[str]:
    return ["--robot", "irma4", "--out", str(path), "--hide", HIDDEN, "--equilibria", "2", "--validate", "1"]


def test_importing_costs_nothing_until_a_name_is_used() -> None:
    program = "import sys, fidim_lab; print([m for m in sys.modules if m in ('numpy', 'casadi', 'pandas')])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_every_public_name_is_there_with_a_docstring_and_no_other() -> None:
    assert set(fl.__all__) <= set(dir(fl))
    for name in fl.__all__:
        assert inspect.getdoc(getattr(fl, name))
    with pytest.raises(AttributeError, match="there are Body, Campaign"):
        _ = fl.identfy


def test_blas_has_one_thread_during_a_call_and_its_own_number_after_it() -> None:
    def threads() -> set[int]:
        return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}

    def identify() -> set[int]:
        return threads()

    with threadpool_limits(limits=2, user_api="blas"):
        assert as_command(identify)() == {1}
        assert threads() == {2}


@pytest.mark.parametrize("name", ["identify", "explain", "validate", "simulate", "design"])
def test_defaults_are_those_of_the_command(name: str) -> None:
    command = cli.fidim.commands[name]
    context = command.make_context(name, [], resilient_parsing=True)
    defaults = {OTHER_NAMES.get(key, key): value for key, value in context.params.items()}
    ours = inspect.signature(getattr(fl, name)).parameters
    needed = inspect.Parameter.empty
    shared = {key for key, one in ours.items() if key in defaults and one.default is not needed}
    assert shared
    for key in shared - ({"robot"} if name == "design" else set()):  # None there: the paper's
        assert (ours[key].default, key) == (defaults[key], key)


def test_identify_gives_what_the_command_gives_to_the_bit(folder: Path, tmp_path: Path) -> None:
    by_command, here = tmp_path / "command.json", tmp_path / "here.json"
    code = cli.run(["identify", str(folder), "--json", str(by_command)])
    found = fl.identify(fl.load(folder))
    found.save(here)
    assert _timeless(here) == _timeless(by_command)
    assert found.ok == (code == 0)


def test_validate_gives_what_the_command_gives_to_the_bit(folder: Path, tmp_path: Path) -> None:
    result, by_command = tmp_path / "result.json", tmp_path / "validation.json"
    found = fl.identify(folder, "tls")
    found.save(result)
    code = cli.run(["validate", str(folder), "--parameters", str(result), "--json", str(by_command)])
    told = json.loads(by_command.read_text())["windows"]
    for parameters in (found, result):
        judged = fl.validate(folder, parameters)
        assert judged.predicts == (code == 0)
        assert [one["chi2_per_dof"] for one in told] == list(judged.to_frame()["chi2_per_dof"])


def test_simulate_writes_what_the_command_writes(folder: Path, tmp_path: Path) -> None:
    campaign = fl.simulate("irma4", tmp_path / "small", hide=[HIDDEN], equilibria=2, validate=1)
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            assert (tmp_path / "small" / path.relative_to(folder)).read_bytes() == path.read_bytes()
    assert repr(campaign) == "Campaign('small': 2 identify, 1 validate; 100 Hz, 4 cables)"


def test_results_print_become_tables_and_are_plotted(folder: Path) -> None:
    campaign = fl.load(folder)
    found = fl.identify(campaign, "tls")
    assert "Inertial parameters" in str(found)
    assert str(found).startswith("small: ")
    assert list(found.to_frame().index) == list(PARAMETER_NAMES)
    np.testing.assert_array_equal(found.to_frame()["value"], found.body.vector)
    assert list(found.windows().index) == [window.id for window in campaign.windows]
    assert "<table" in found._repr_html_()
    judged = fl.validate(campaign, found)
    assert "verdict" in str(judged)
    for shown in (campaign, found, judged):
        assert shown.plot().axes
        assert len(repr(shown)) < 400


def test_a_robot_checks_and_draws_itself(tmp_path: Path) -> None:
    robot = fl.load_robot("irma4")
    assert repr(robot) == "Robot(4 cables, 11 kg, 1 marker, 2 freedoms)"
    assert robot.check()["ok"].all()
    assert "from above" in robot.draw()
    robot.write(tmp_path / "copy.toml")
    np.testing.assert_array_equal(fl.Robot.read(tmp_path / "copy.toml").cables[3].d, robot.cables[3].d)


def test_mistakes_are_sentences(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(fl.FidimError, match="no such folder"):
        fl.load(tmp_path / "none")
    with pytest.raises(fl.FidimError, match="mle"):
        fl.identify(folder, "magic")
    with pytest.raises(fl.FidimError, match="takes the folder"):
        fl.identify(fl.load(folder), pose_from="swivel")
    with pytest.raises(fl.FidimError, match="no pose_from='moccap'; available: mocap"):
        fl.identify(folder, pose_from="moccap")  # type: ignore[arg-type]
    for wrong in (3, fl.load_robot("irma4")):
        with pytest.raises(fl.FidimError, match="is not a campaign"):
            fl.explain(wrong)  # type: ignore[arg-type]
    with pytest.raises(fl.FidimError, match="equilibria=0"):
        fl.simulate("irma4", tmp_path / "empty", equilibria=0)
    with pytest.raises(fl.FidimError, match="exists already"):
        fl.simulate("irma4", folder)


@pytest.mark.slow
def test_the_example_finds_the_anchor(tmp_path: Path) -> None:
    main = runpy.run_path(str(ROOT / "examples" / "python" / "identify_and_explain.py"))["main"]
    found, answer, judged = main(str(tmp_path / "new"))
    assert found.result.geometry is not None
    assert judged.predicts  # with the geometry that identify has found
    assert answer.effects == ("anchor-offset:2",)
    assert (tmp_path / "new" / "report.html").exists()


def _timeless(path: Path) -> dict[str, object]:
    told = json.loads(path.read_text())
    del told["seconds"]
    return told


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"without": "air"}, "without air: no such effect"),
        ({"without": "swivel-frction"}, "Did you mean swivel-friction"),
        ({"patience": -1}, "patience=-1 is not in the range x>=0"),
    ],
)
def test_explain_refuses_what_it_would_silently_ignore(folder, wrong, says):
    with pytest.raises(fl.FidimError, match=says):
        fl.explain(folder, **wrong)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda f, new: fl.simulate("irma4", new, seed=-1), "seed=-1 is not in the range x>=0"),
        (lambda f, new: fl.simulate("irma4", new, seed=1.5), "seed=1.5: a whole number is expected"),
        (lambda f, new: fl.simulate("irma4", new, noise="a"), "noise='a': a number is expected"),
        (lambda f, new: fl.simulate("irma4", new, backend="bullet"), "no backend='bullet'; available: native, mujoco"),
        (lambda f, new: fl.simulate("irma4", new, hide="drag"), "hide drag: no effect"),
        (lambda f, new: fl.simulate("irma4", f), "Choose another out"),
        (lambda f, new: fl.design("irma4", criterion="Z"), "no criterion='Z'; available: C, A, D"),
        (lambda f, new: fl.design("irma4", robust=3), "robust averages A or D"),
        (lambda f, new: fl.validate(f, "x.json", limit=0), "limit=0 is not in the range x>0"),
        (lambda f, new: fl.identify(replace(fl.load(f), windows=())), "holds no windows"),
        (lambda f, new: fl.explain(replace(fl.load(f), windows=())), "holds no windows"),
    ],
)
def test_a_mistake_is_told_in_the_words_of_python(folder, tmp_path, call, says):
    with pytest.raises(fl.FidimError, match=says) as told:
        call(folder, tmp_path / "new")
    assert "--" not in str(told.value)


@pytest.mark.parametrize(
    ("command", "python"),
    [
        ("Add --criterion A or D.", "Add criterion A or D."),
        ("--all judges the windows too.", "everything judges the windows too."),
        (
            "Write fidim dry-run --robot FILE --out DIR, then --plan.",
            "Write fidim dry-run --robot FILE --out DIR, then plan.",
        ),
        ("--pose-from swivel: why?", "pose_from swivel: why?"),
    ],
)
def test_options_are_arguments_but_a_command_stays_a_command(command, python):
    assert in_python(command) == python


def test_one_effect_may_be_hidden_by_its_text_alone(tmp_path):
    campaign = fl.simulate("irma4", tmp_path / "c", hide="gravity-tilt", equilibria=1, validate=0, seed=3)
    assert len(campaign.windows) == 1
