"""Compiled kernels: the same digits, kept for the next time, and done without where there is no compiler."""

import logging
import pickle

import casadi as ca
import numpy as np
import pytest

from fidim_lab.model.batch import over_samples
from fidim_lab.model.kinematics import pose_from_lengths
from fidim_lab.model.mechanism import Mechanism
from fidim_lab.model.modes import modes
from fidim_lab.model.motion import simulate_free_motion
from fidim_lab.model.native import Kernel, built, cache_folder, compiler
from fidim_lab.model.sensitivity.equations import derivatives
from fidim_lab.model.sensitivity.grid import QUICK, Grid
from fidim_lab.model.sensitivity.integrate import States, integrate, step_of
from fidim_lab.model.sensitivity.starts import linearised_starts
from fidim_lab.model.sensitivity.variation import variations


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "fidim-lab"


def square():
    x = ca.SX.sym("x", 2)
    return ca.Function("square", [x], [x * x + ca.sin(x)])


@pytest.mark.skipif(compiler() is None, reason="no C compiler here")
def test_a_built_function_is_kept_and_needs_no_compiler_again(cache, monkeypatch, caplog):
    with caplog.at_level(logging.INFO):
        first = built(square())
    (said,) = caplog.messages
    assert "compiling square with" in said
    assert str(cache) in said
    (library,) = cache.glob("*.so")
    monkeypatch.setenv("PATH", "")
    again = built(square())
    assert first.class_name() == again.class_name() == "External"
    assert caplog.messages == [said]
    assert [path.name for path in cache.iterdir()] == [library.name]
    assert float(again([0.3, 0.7])[1]) == float(square()([0.3, 0.7])[1])


def test_without_a_compiler_the_function_itself_is_used_and_it_is_said(cache, monkeypatch, caplog):
    monkeypatch.setenv("PATH", "")
    with caplog.at_level(logging.WARNING):
        assert built(square()).class_name() == "SXFunction"
    assert "square runs about 15 times slower" in caplog.text
    assert "no C compiler" in caplog.text
    assert not cache.exists()


def test_a_cache_that_cannot_be_written_is_done_without(tmp_path, monkeypatch, caplog):
    (tmp_path / "fidim-lab").write_text("a file where the folder should be")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "fidim-lab"
    assert built(square()).class_name() == "SXFunction"
    assert "square runs" in caplog.text


@pytest.mark.skipif(compiler() is None, reason="no C compiler here")
def test_a_native_simulation_has_the_same_digits(paper, cache):
    native = Mechanism(paper.robot, native=True)
    body = paper.robot.nominal
    rest = pose_from_lengths(paper, body, np.array([1.38, 1.39, 1.36, 1.32]))
    twist = 0.3 * modes(paper, body, rest).shapes.sum(axis=1)
    times = np.arange(0, 10.0001, 0.01)
    slow, fast = (simulate_free_motion(made, body, rest.pose, twist, times) for made in (paper, native))
    np.testing.assert_array_equal(slow.motion.positions, fast.motion.positions)
    np.testing.assert_array_equal(slow.tensions, fast.tensions)
    assert len(list(cache.glob("motion_step-*.so"))) == 1
    assert pickle.loads(pickle.dumps(native)).native


@pytest.mark.skipif(compiler() is None, reason="no C compiler here")
def test_a_kernel_is_used_while_it_is_built(cache):
    kernel = Kernel.of(square())
    given = np.array([[0.3, 0.5], [0.7, 0.1]])
    before = over_samples(kernel.now() if kernel.build is not None else square(), 2, given)
    kernel.wait()
    assert kernel.now().class_name() == "External"
    np.testing.assert_array_equal(over_samples(kernel.now(), 2, given), before)


def test_a_kernel_that_is_not_asked_for_is_the_function(cache):
    function = square()
    assert Kernel.of(function, native=False).now() is function
    assert not cache.exists()


@pytest.mark.skipif(compiler() is None, reason="no C compiler here")
def test_native_trajectories_and_their_derivatives_have_the_same_digits(paper, cache):
    body = paper.robot.nominal
    rest = pose_from_lengths(paper, body, np.array([1.38, 1.39, 1.36, 1.32]))
    twist = 0.3 * modes(paper, body, rest).shapes.sum(axis=1)
    states = States(rest.pose.position[np.newaxis], rest.pose.rotation[np.newaxis], twist[np.newaxis])
    grid, begins, found = Grid.covering(2.0, QUICK), np.zeros(1), []
    for made in (Mechanism(paper.robot), Mechanism(paper.robot, native=True)):
        step_of(made).wait()
        derivatives(made).wait()
        trajectories = integrate(made, body.vector, states, grid, begins)
        starts = linearised_starts(made, body.vector, states, begins)
        found.append((trajectories, variations(made, trajectories, body.vector, starts.states_by)))
    (slow, slow_by), (fast, fast_by) = found
    assert len(list(cache.glob("*.so"))) == 2
    np.testing.assert_array_equal(slow.positions, fast.positions)
    np.testing.assert_array_equal(slow.tensions, fast.tensions)
    np.testing.assert_array_equal(slow_by.poses, fast_by.poses)
