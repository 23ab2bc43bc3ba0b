"""The designed equilibria in the workspace, from above and from the side, as SVG."""

from pathlib import Path

import numpy as np

from fidim_lab.identification.design.search import Design


def write_picture(found: Design, path: Path) -> None:
    """Anchors, equilibria with their numbers, and the paths of the marker."""
    import matplotlib as mpl

    mpl.use("Agg")
    mpl.rcParams["svg.hashsalt"] = "fidim"
    from matplotlib import pyplot

    robot, motions = found.task.robot, found.motions
    paths = motions.trajectories.positions + motions.trajectories.rotations @ robot.marker
    anchors = np.array([cable.d for cable in robot.cables])
    figure, views = pyplot.subplots(1, 2, figsize=(10, 5), layout="constrained")
    for view, (a, b), title in zip(views, ((0, 1), (0, 2)), ("from above", "from the side"), strict=True):
        view.plot(anchors[:, a], anchors[:, b], "s", color="0.2", label="anchors")
        for k, path_of in enumerate(paths):
            view.plot(path_of[:, a], path_of[:, b], lw=0.6, color="C0")
            view.plot(*found.rests[k][[a, b]], ".", color="C3", ms=4)
            view.annotate(str(k + 1), found.rests[k][[a, b]], fontsize=8, xytext=(3, 3), textcoords="offset points")
        view.set(xlabel="xyz"[a] + " / m", ylabel="xyz"[b] + " / m", title=title, aspect="equal")
    figure.suptitle(f"{found.task.equilibria} equilibria, C = {found.C:.2f}")
    figure.savefig(path, format="svg", metadata={"Date": None})
    pyplot.close(figure)
