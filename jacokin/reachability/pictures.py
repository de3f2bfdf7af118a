"""Maps as pictures: two slices and a view in space, or that view turning; a page that turns it is in `page`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from jacokin import files
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, MissingExtraError
from jacokin.model import checks
from jacokin.reachability.sampling.grid import Grid
from jacokin.reachability.sampling.orientations import Orientations

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from PIL.Image import Image

ENDINGS = (".png", ".svg", ".pdf", ".apng", ".gif", ".html")
TURNING = {".apng": "PNG", ".gif": "GIF"}
VIEWS = 36  # of a full turn
VIEW_TIME = 100  # [ms] that each is shown
COLOURS = "viridis"
POINTS = 12_000  # cells in a view of space, at most


class DrawnMap(Protocol):
    """What a picture needs of a `ReachabilityMap`, whose module imports this one."""

    @property
    def recipe(self) -> dict[str, Any]:
        """As in `ReachabilityMap`."""

    @property
    def grid(self) -> Grid:
        """As in `ReachabilityMap`."""

    @property
    def orientations(self) -> Orientations:
        """As in `ReachabilityMap`."""

    @property
    def fraction(self) -> Array:
        """As in `ReachabilityMap`."""


def draw(map: DrawnMap, path: str | Path) -> None:  # noqa: A002 - as everywhere in this package
    """See `ReachabilityMap.plot`."""
    if not isinstance(path, str | Path):
        raise InvalidInputError(f"path must be a str or a Path, got {checks.shown(path)}")
    out = Path(checks.text("path", str(path)))
    if out.suffix not in ENDINGS:
        raise InvalidInputError(f"{out}: pictures of maps are written as {', '.join(ENDINGS)}, told by the ending")
    if out.suffix == ".html":
        from jacokin.reachability.page import page

        points, values = shown_cells(map)
        title = f"{map.recipe['robot']['name']}, frame {map.recipe['frame']}: {map.orientations.name}"
        with files.replacing(out) as written:
            written.write_text(page(title, points, values, map.grid.spacing), encoding="utf-8")
        return
    figure = figure_of(map) if out.suffix not in TURNING else None
    views = [] if figure is not None else list(turning_views(map))
    with files.replacing(out) as written:
        if figure is not None:
            figure.savefig(written, format=out.suffix[1:], dpi=120)
        else:
            views[0].save(
                written,
                format=TURNING[out.suffix],
                save_all=True,
                append_images=views[1:],
                duration=VIEW_TIME,
                loop=0,
            )


def figure_of(map: DrawnMap) -> Figure:  # noqa: A002 - as everywhere in this package
    """A vertical slice, a horizontal one at the most dexterous height, and the cells in space.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("matplotlib", "plot") from error
    grid, fraction = map.grid, map.fraction
    figure = Figure(figsize=(13.0, 4.4), layout="constrained")
    middle = int(np.argmin(np.abs(grid.axis(1))))
    height = int(np.argmax(fraction.sum(axis=(0, 1))))
    sides = [(float(grid.lower[axis]), float(grid.lower[axis] + grid.shape[axis] * grid.spacing)) for axis in range(3)]
    for place, (values, across, title) in enumerate(
        (
            (fraction[:, middle], (0, 2), f"y = {grid.axis(1)[middle]:.2f} m"),
            (fraction[:, :, height], (0, 1), f"z = {grid.axis(2)[height]:.2f} m"),
        )
    ):
        axes = figure.add_subplot(1, 3, place + 1)
        shown = np.ma.masked_equal(values.T, 0.0)
        extent = (*sides[across[0]], *sides[across[1]])
        image = axes.imshow(shown, origin="lower", extent=extent, cmap=COLOURS, vmin=0.0, vmax=1.0)
        axes.set(xlabel=f"{'xyz'[across[0]]} [m]", ylabel=f"{'xyz'[across[1]]} [m]", title=title)
    figure.colorbar(image, ax=axes, label="fraction of orientations reached")
    _draw_space(map, figure.add_subplot(1, 3, 3, projection="3d"))
    return figure


def turning_views(map: DrawnMap) -> Iterator[Image]:  # noqa: A002 - as everywhere in this package
    """The cells in space, seen from all around.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
        from PIL.Image import fromarray
    except ImportError as error:
        raise MissingExtraError("matplotlib", "plot") from error
    figure = Figure(figsize=(5.0, 4.6))
    canvas: Any = FigureCanvasAgg(figure)  # Any: its methods have no types
    space = figure.add_subplot(projection="3d")
    _draw_space(map, space)
    for view in range(VIEWS):
        space.view_init(elev=20.0, azim=-60.0 + 360.0 * view / VIEWS)
        canvas.draw()
        yield fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())


def _draw_space(map: DrawnMap, space: Any) -> None:  # noqa: A002 - as everywhere in this package; Any: Axes3D, without types
    """The cells with y >= 0 in space: the other half is left out, so that the inside is seen."""
    points, values = shown_cells(map)
    behind = points[:, 1] >= 0.0
    space.scatter(*points[behind].T, c=values[behind], cmap=COLOURS, vmin=0.0, vmax=1.0, s=3.0, linewidths=0.0)
    space.set(xlabel="x [m]", ylabel="y [m]", title=f"{map.recipe['robot']['name']}, y >= 0")
    space.locator_params(nbins=4)
    space.set_box_aspect([float(count) for count in map.grid.shape])
    space.view_init(elev=20.0, azim=-60.0)


def shown_cells(map: DrawnMap) -> tuple[Array, Array]:  # noqa: A002 - as everywhere in this package
    """Centres (n, 3) [m] and fractions (n,) of cells that are reached; every second, third, ... one of a fine grid."""
    stride = 1
    while True:
        some = (slice(stride // 2, None, stride),) * 3
        values = map.fraction[some]
        if np.count_nonzero(values) <= POINTS:
            axes = [map.grid.axis(index)[some[index]] for index in range(3)]
            centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
            return centres[values > 0.0], values[values > 0.0]
        stride += 1
