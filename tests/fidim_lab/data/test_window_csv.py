import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from fidim_lab.data.window_csv import MIN_SAMPLES, WindowColumns, read_window_csv, write_window_csv
from fidim_lab.errors import FileError


def text(rows: int = 30, head: str = "t,x,y,z,l1,l2", cells: str = "1,2,3,4,5") -> list[str]:
    return [head, *(f"{0.01 * k:.2f},{cells}" for k in range(rows))]


def write(tmp_path: Path, lines: list[str]) -> Path:
    path = tmp_path / "w.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_blank_is_a_missing_sample_and_further_columns_are_kept(tmp_path: Path) -> None:
    lines = text(head="t,x,y,z,l1,l2,load cell", cells="1,,3,4,5,6")
    window = read_window_csv(write(tmp_path, lines), 2)
    assert np.isnan(window.markers[:, 0, 1]).all()
    assert window.lengths is not None
    assert window.lengths.shape == (30, 2)
    assert window.currents is None
    np.testing.assert_array_equal(window.further["load cell"], np.full(30, 6.0))


@pytest.mark.parametrize(
    ("edit", "expected"),
    [
        (lambda s: s[:0], "line 1.*empty"),
        (lambda s: ["t,x,y", *s[1:]], "line 1: column z is missing"),
        (lambda s: ["t,x,y,z,z,l2", *s[1:]], "line 1: column z occurs twice"),
        (lambda s: ["t,x,y,z,l1,l3", *s[1:]], "line 1: columns l1, l3 for a robot of 2 cables; l1, l2"),
        (lambda s: ["t,x,y,z,m2x,m2y", *s[1:]], "marker 2 lacks column m2z"),
        (lambda s: [*s[:5], "0.04,1,2,3", *s[6:]], "line 6: 4 columns, the header has 6"),
        (lambda s: [*s[:5], "0.04,1,2,three,4,5", *s[6:]], "line 6, column z: 'three' is not a number"),
        (lambda s: [*s[:5], "0.04,1,2,inf,4,5", *s[6:]], "line 6, column z: 'inf' is not a finite"),
        (lambda s: [*s[:5], "0.02,1,2,3,4,5", *s[6:]], "line 6: time 0.02 s goes back from 0.03 s"),
        (lambda s: [*s[:5], "0.03,1,2,3,4,5", *s[6:]], "line 6: time 0.03 s repeats 0.03 s"),
        (lambda s: [*s[:5], ",1,2,3,4,5", *s[6:]], "line 6, column t: a sample without its time"),
        (lambda s: s[: MIN_SAMPLES - 3], "17|samples; a window needs"),
    ],
)
def test_each_mistake_has_file_and_line(tmp_path: Path, edit: object, expected: str) -> None:
    path = write(tmp_path, edit(text()))  # type: ignore[operator]
    if path.read_text() == "\n":
        path.write_text("")
    with pytest.raises(FileError, match=expected) as error:
        read_window_csv(path, 2)
    assert str(path) in str(error.value)


@settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    values=arrays(float, (MIN_SAMPLES, 6 + 2), elements=st.floats(-50, 50)),
    holes=arrays(bool, (MIN_SAMPLES, 6)),
    steps=arrays(float, MIN_SAMPLES, elements=st.floats(1e-3, 1.0)),
)
def test_what_is_written_reads_back(tmp_path: Path, values: np.ndarray, holes: np.ndarray, steps: np.ndarray) -> None:
    markers = np.where(holes, math.nan, values[:, :6]).reshape(MIN_SAMPLES, 2, 3)
    written = WindowColumns(np.cumsum(steps), markers, values[:, 6:], None, {"note": values[:, 0]})
    write_window_csv(tmp_path / "w.csv", written)
    back = read_window_csv(tmp_path / "w.csv", 2)
    np.testing.assert_allclose(back.t, written.t, atol=0.6e-4)
    np.testing.assert_allclose(back.markers, written.markers, atol=0.6e-6)
    np.testing.assert_allclose(back.lengths, written.lengths, atol=0.6e-6)  # type: ignore[arg-type]
    np.testing.assert_allclose(back.further["note"], written.further["note"], atol=0.6e-6)


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.one_of(st.binary(max_size=300), st.text(alphabet="txyzl12,.\n-0e ", max_size=400).map(str.encode)))
def test_any_bytes_are_refused_with_the_file_named(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "w.csv"
    path.write_bytes(data)
    with pytest.raises(FileError, match=re.escape(str(path))):
        read_window_csv(path, 2)


@pytest.mark.parametrize("lengths", [True, False])
@pytest.mark.parametrize("currents", [True, False])
def test_lengths_and_currents_may_be_absent_each(tmp_path: Path, lengths: bool, currents: bool) -> None:
    series = np.full((MIN_SAMPLES, 3), 1.5)
    markers = np.zeros((MIN_SAMPLES, 1, 3))
    t = np.arange(MIN_SAMPLES) * 0.01
    write_window_csv(
        tmp_path / "w.csv", WindowColumns(t, markers, series if lengths else None, series if currents else None, {})
    )
    back = read_window_csv(tmp_path / "w.csv", 3)
    assert (back.lengths is not None, back.currents is not None) == (lengths, currents)


@pytest.mark.parametrize("left", ["0.0", "0.", "0", ""])
def test_a_file_that_was_cut_within_its_last_number_is_refused(tmp_path: Path, left: str) -> None:
    lines = text(head="t,x,y,z", cells="0.1,0.2,0.300")
    path = tmp_path / "w.csv"
    path.write_text("\n".join([*lines[:-1], f"{lines[-1].rpartition(',')[0]},{left}"]))
    with pytest.raises(FileError, match="line 31: the file was cut"):
        read_window_csv(path, 2)


@pytest.mark.parametrize("cells", ["0.1,0.2,0.300", "0.1,0.2,3", "0.1,0.2,1.5e-3"])
def test_a_last_line_without_an_end_is_whole(tmp_path: Path, cells: str) -> None:
    path = tmp_path / "w.csv"
    path.write_text("\n".join(text(head="t,x,y,z", cells=cells)))
    assert len(read_window_csv(path, 2).t) == 30
