"""All estimators on the real recording against CAD, with the spread between fits that leave one window out.

    python -m benchmarks.identification.real ../shared/recordings/irma4u

CAD is itself unverified, and enters fits only as a start and a weak prior.
"""

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.page import table, write_section
from fidim_lab.data.campaign import read_campaign
from fidim_lab.data.records import PARAMETER_NAMES, Body, Campaign, Role
from fidim_lab.errors import FidimError, RefusedError
from fidim_lab.identification.equations import least_squares, total_least_squares
from fidim_lab.identification.equations.problem import build
from fidim_lab.identification.mle.soft import fit_soft
from fidim_lab.identification.motion.recipe import BEST, PAPER

TITLE = "The real recording, against CAD"
SHOWN = ("s_x", "s_y", "s_z − a_z", "I_xx", "I_yy", "I_zz")


@dataclass(frozen=True)
class Answer:
    """What one estimator makes of a campaign."""

    body: Body
    fitted: float | None = None
    """mm rms of the fitted windows' markers"""
    held: tuple[tuple[str, float, int], ...] = ()
    """window, mm rms and rows of those held out"""


def trajectory(campaign: Campaign) -> Answer:
    soft = fit_soft(campaign, native=True)
    held: list[tuple[str, float, int]] = []
    for window in campaign.of_role(Role.VALIDATE):
        try:
            left = soft.predict(window).remainder
            held.append((window.id, left.rms * 1e3, len(left.t)))
        except RefusedError:
            held.append((window.id, np.inf, len(window.t)))
    fitted = float(np.sqrt(np.mean([left.rms**2 for left in soft.found.remainders]))) * 1e3
    return Answer(soft.found.body, fitted, tuple(held))


ESTIMATORS: dict[str, Callable[[Campaign], Answer]] = {
    "tls, as the paper": lambda c: Answer(total_least_squares.estimate(build(c, PAPER)).body),
    "tls": lambda c: Answer(total_least_squares.estimate(build(c, BEST)).body),
    "ls": lambda c: Answer(least_squares.estimate_ls(build(c, BEST)).body),
    "iv": lambda c: Answer(least_squares.estimate_iv(build(c, BEST)).body),
    "mle, elastic cables": trajectory,
}


def imported(recording: Path) -> Campaign:
    """The recording as `fidim import irma4u` makes a campaign of it."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "irma4u"
        fidim = Path(sys.executable).with_name("fidim")
        command = [str(fidim), "import", "irma4u", str(recording), "--out", str(out)]
        if subprocess.run(command, stdout=subprocess.DEVNULL).returncode:  # it has said why
            raise SystemExit(2)
        return read_campaign(out)


def leaving_out(campaign: Campaign, window: str) -> Campaign:
    """Fitted on all windows but one, whatever their roles were."""
    windows = tuple(replace(w, role=Role.VALIDATE if w.id == window else Role.IDENTIFY) for w in campaign.windows)
    return replace(campaign, windows=windows)


def shown(body: Body, attachment: float) -> np.ndarray:
    values: dict[str, float] = {name: float(v) for name, v in zip(PARAMETER_NAMES, body.vector, strict=True)}
    values["s_z − a_z"] = values["s_z"] - attachment
    return np.array([values[name] for name in SHOWN])


def row(name: str, estimate: Callable[[Campaign], Answer], campaign: Campaign) -> list[object]:
    attachment = campaign.robot.attachment_plane
    cad = shown(campaign.robot.nominal, attachment)
    try:
        answer = estimate(campaign)
        others = [estimate(leaving_out(campaign, window.id)) for window in campaign.windows]
    except FidimError as error:
        return [name, f"refused: {error}", *[""] * (len(SHOWN) + 2)]
    values = shown(answer.body, attachment)
    without = np.array([shown(other.body, attachment) for other in others])
    spread = np.sqrt((len(without) - 1) / len(without) * ((without - without.mean(axis=0)) ** 2).sum(axis=0))
    cells: list[str] = []
    for k in range(len(SHOWN)):
        unit = 1e3
        off = f" ({100 * (values[k] / cad[k] - 1):+.1f} %)" if abs(cad[k]) > 1e-3 else ""
        cells.append(f"{unit * values[k]:.2f} ± {unit * spread[k]:.2f}{off}")
    missed = [held for other in others for held in other.held]
    total = ""
    if missed:
        rms = np.sqrt(sum(size**2 * rows for _, size, rows in missed) / sum(rows for *_, rows in missed))
        total = f"{rms:.2f} ({', '.join(f'{window} {size:.1f}' for window, size, _ in missed)})"
    held = ", ".join(f"{window} {size:.2f}" for window, size, _ in answer.held)
    fitted = "" if answer.fitted is None else f"{answer.fitted:.2f} / {held}"
    return [name, *cells, fitted, total]


def all_windows(campaign: Campaign) -> list[object]:
    """Elastic cables fitted to every window; nothing is left to judge by."""
    everything = replace(campaign, windows=tuple(replace(w, role=Role.IDENTIFY) for w in campaign.windows))
    answer = trajectory(everything)
    attachment = campaign.robot.attachment_plane
    values, cad = shown(answer.body, attachment), shown(campaign.robot.nominal, attachment)
    cells = [
        f"{1e3 * value:.2f}" + (f" ({100 * (value / wanted - 1):+.1f} %)" if abs(wanted) > 1e-3 else "")
        for value, wanted in zip(values, cad, strict=True)
    ]
    return ["the same, all windows fitted", *cells, f"{answer.fitted:.2f}", ""]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    options = parser.parse_args()
    campaign = imported(options.recording)
    attachment = campaign.robot.attachment_plane
    cad = ["CAD", *(f"{1e3 * value:.2f}" for value in shown(campaign.robot.nominal, attachment)), "", ""]
    rows = [cad, *(row(name, estimate, campaign) for name, estimate in ESTIMATORS.items()), all_windows(campaign)]
    units = [f"{name}, mm" if name.startswith("s") else f"{name}, 1e-3 m²" for name in SHOWN]
    head = ["estimator", *units, "fitted / held out, mm rms", "left out one by one, mm rms"]
    fitted = ", ".join(window.id for window in campaign.of_role(Role.IDENTIFY))
    text = f"""Values from {fitted}, as the importer chooses them; ± is the jackknife over all {len(campaign.windows)}
windows, fits that leave one out. s from P, inertia about P over the mass; s_z relative to the attachments, since
lengths show no more. CAD is unverified (the laboratory's own files differ by 14 mm in a_z).

{table(head, rows)}"""
    print(text)
    write_section("identification", TITLE, "python -m benchmarks.identification.real RECORDING", text)


if __name__ == "__main__":
    main()
