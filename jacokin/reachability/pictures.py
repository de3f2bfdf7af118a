"""`draw` writes a map as a picture: slices and a view in space, that view turning, or a page that turns it."""

from __future__ import annotations

import html
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
import orjson
import pinocchio as pin

from jacokin import files
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, needed
from jacokin.model import checks
from jacokin.model.point_cloud import PointCloud
from jacokin.model.robot import Robot
from jacokin.model.scene import Scene
from jacokin.reachability.samples import Grid

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from PIL.Image import Image

ENDINGS = (".png", ".svg", ".pdf", ".apng", ".gif", ".html")
TURNING = {".apng": "PNG", ".gif": "GIF"}
VIEWS = 36  # of a full turn
COLOURS = "viridis"
Lines = Sequence[tuple[Array, str]]  # (k, 3) points [m], and a colour


def draw(
    path: str | Path,
    grid: Grid,
    fraction: Array,
    robot: str,
    title: str,
    arm: Sequence[Array] = (),
    obstacles: Sequence[Array] = (),
) -> None:
    """Draw a map; see `ReachabilityMap.plot`.

    Args:
        path: where to, which also tells the format.
        grid: of the map.
        fraction: (nx, ny, nz) of the orientations, reached in each cell.
        robot: name of the robot.
        title: what is shown.
        arm: lines (k, 3) that stand for it [m].
        obstacles: lines along their edges.
    """
    lines = [(line, "black") for line in arm] + [(line, "tab:gray") for line in obstacles]
    out = Path(checks.text("path", str(checks.path("path", path))))
    if out.suffix not in ENDINGS:
        raise InvalidInputError(f"{out}: pictures of maps are written as {', '.join(ENDINGS)}, told by the ending")
    with files.replacing(out) as written:
        if out.suffix == ".html":
            page = _write_page(title, *_shown_cells(grid, fraction), grid.spacing, arm, obstacles)
            written.write_text(page, encoding="utf-8")
        elif out.suffix in TURNING:
            first, *others = _draw_turning(grid, fraction, robot, lines)
            kind = TURNING[out.suffix]
            first.save(written, format=kind, save_all=True, append_images=others, duration=100, loop=0)  # [ms]
        else:
            _draw_figure(grid, fraction, robot, lines).savefig(written, format=out.suffix[1:], dpi=120)


def _draw_figure(grid: Grid, fraction: Array, robot: str, lines: Lines) -> Figure:
    """A vertical slice, a horizontal one at the most dexterous height, and the cells in space.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    with needed("matplotlib", "plot"):
        from matplotlib.figure import Figure
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
        for line, colour in lines:
            axes.plot(*line[:, across].T, color=colour, linewidth=1.0)
        axes.set(xlim=extent[:2], ylim=extent[2:])
        axes.set(xlabel=f"{'xyz'[across[0]]} [m]", ylabel=f"{'xyz'[across[1]]} [m]", title=title)
    figure.colorbar(image, ax=axes, label="fraction of orientations reached")
    _draw_space(grid, fraction, robot, lines, figure.add_subplot(1, 3, 3, projection="3d"))
    return figure


def _draw_turning(grid: Grid, fraction: Array, robot: str, lines: Lines) -> Iterator[Image]:
    """The cells in space, seen from all around.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    with needed("matplotlib", "plot"):
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
        from PIL.Image import fromarray
    figure = Figure(figsize=(5.0, 4.6))
    canvas: Any = FigureCanvasAgg(figure)  # Any: its methods have no types
    space = figure.add_subplot(projection="3d")
    _draw_space(grid, fraction, robot, lines, space)
    for view in range(VIEWS):
        space.view_init(elev=20.0, azim=-60.0 + 360.0 * view / VIEWS)
        canvas.draw()
        yield fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())


def _draw_space(
    grid: Grid, fraction: Array, robot: str, lines: Lines, space: Any
) -> None:  # Any: Axes3D, without types
    """The cells with y >= 0 in space: the other half is left out, so that the inside is seen."""
    points, values = _shown_cells(grid, fraction)
    behind = points[:, 1] >= 0.0
    space.scatter(*points[behind].T, c=values[behind], cmap=COLOURS, vmin=0.0, vmax=1.0, s=3.0, linewidths=0.0)
    for line, colour in lines:
        space.plot(*line.T, color=colour, linewidth=1.0)
    space.set(xlabel="x [m]", ylabel="y [m]", title=f"{robot}, y >= 0")
    space.locator_params(nbins=4)
    space.set_box_aspect([float(count) for count in grid.shape])
    space.view_init(elev=20.0, azim=-60.0)


def _shown_cells(grid: Grid, fraction: Array) -> tuple[Array, Array]:
    """Centres (n, 3) [m] and fractions (n,) of cells that are reached; every second, third, ... one of a fine grid."""
    stride = 1
    while True:
        some = (slice(stride // 2, None, stride),) * 3
        values = fraction[some]
        if np.count_nonzero(values) <= 12_000:  # as many as a view shows well
            axes = [grid.axis(index)[some[index]] for index in range(3)]
            centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
            return centres[values > 0.0], values[values > 0.0]
        stride += 1


_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>@TITLE@</title>
<style>body{margin:0;background:#111;color:#ddd;font:14px sans-serif}canvas{display:block}
p{position:absolute;margin:10px}</style></head>
<body><p>@TITLE@<br>drag to turn, wheel to zoom; colour: fraction of orientations reached (dark 0, bright 1);
axes of the base, the arm in white, obstacles in grey</p>
<canvas id="view"></canvas><script>
const data = @DATA@;
const canvas = document.getElementById("view"), pen = canvas.getContext("2d");
let turn = 0.6, tilt = 0.35, zoom = 1, moving = true, held = null;
const stops = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
function colour(value) {
  const place = Math.min(value * 4, 3.999), low = stops[Math.floor(place)], high = stops[Math.floor(place) + 1];
  return "rgb(" + low.map((part, i) => Math.round(part + (high[i] - part) * (place % 1))).join(",") + ")";
}
const colours = data.values.map(colour);
const low = [0, 1, 2].map(i => Math.min(...data.points.map(p => p[i])));
const high = [0, 1, 2].map(i => Math.max(...data.points.map(p => p[i])));
const centre = low.map((value, i) => (value + high[i]) / 2), size = Math.max(...low.map((value, i) => high[i] - value));
const axes = [["x", "#f55", [0.5, 0, 0]], ["y", "#5d5", [0, 0.5, 0]], ["z", "#69f", [0, 0, 0.5]]];
function draw() {
  canvas.width = innerWidth; canvas.height = innerHeight;
  const scale = zoom * Math.min(canvas.width, canvas.height) / (1.3 * size);
  const c = Math.cos(turn), s = Math.sin(turn), ct = Math.cos(tilt), st = Math.sin(tilt);
  const project = p => {
    const x = p[0] - centre[0], y = p[1] - centre[1], z = p[2] - centre[2];
    const across = c * x - s * y, away = s * x + c * y;
    return [across, ct * z + st * away, ct * away - st * z];
  };
  const onScreen = p => {
    const [x, y] = project(p);
    return [canvas.width / 2 + scale * x, canvas.height / 2 - scale * y];
  };
  const line = (points, colour, width) => {
    pen.strokeStyle = colour; pen.lineWidth = width; pen.beginPath();
    for (const p of points) pen.lineTo(...onScreen(p));
    pen.stroke();
  };
  const seen = data.points.map((p, i) => [...project(p), i]).sort((a, b) => b[2] - a[2]);
  const side = Math.max(1, 0.55 * data.spacing * scale);
  for (const [x, y, , i] of seen) {
    pen.fillStyle = colours[i];
    pen.fillRect(canvas.width / 2 + scale * x - side / 2, canvas.height / 2 - scale * y - side / 2, side, side);
  }
  for (const points of data.obstacles) line(points, "#aaa", 1);
  for (const points of data.arm) line(points, "#fff", 4);
  pen.font = "14px sans-serif"; pen.lineCap = pen.lineJoin = "round";
  for (const [name, colour, end] of axes) {
    line([[0, 0, 0], end], colour, 2);
    pen.fillStyle = colour; pen.fillText(name, ...onScreen(end.map(value => 1.1 * value)));
  }
  pen.fillStyle = "#ddd";  // the scale: as long as the axes are in space
  pen.fillRect(20, canvas.height - 24, 0.5 * scale, 3); pen.fillText("0.5 m", 20, canvas.height - 32);
  if (moving) { turn += 0.004; requestAnimationFrame(draw); }
}
canvas.onpointerdown = event => { moving = false; held = [event.clientX, event.clientY]; };
canvas.onpointermove = event => {
  if (!held) return;
  turn += 0.01 * (event.clientX - held[0]); tilt += 0.01 * (event.clientY - held[1]);
  held = [event.clientX, event.clientY]; draw();
};
onpointerup = () => { held = null; };
canvas.onwheel = event => { zoom *= Math.exp(-0.001 * event.deltaY); event.preventDefault(); if (!moving) draw(); };
onresize = () => { if (!moving) draw(); };
draw();
</script></body></html>
"""


def _write_page(
    title: str, points: Array, values: Array, spacing: float, arm: Sequence[Array], obstacles: Sequence[Array]
) -> str:
    """The page that turns a map in the browser.

    Args:
        title: what is shown.
        points: (n, 3) centres of cells [m].
        values: (n,) fraction reached in each.
        spacing: length of an edge of a cell [m].
        arm: lines (k, 3) that stand for it [m].
        obstacles: lines along their edges.
    """
    data = {
        "points": points.round(4).tolist(),
        "values": values.round(3).tolist(),
        "spacing": spacing,
        "arm": [line.round(4).tolist() for line in arm],
        "obstacles": [line.round(4).tolist() for line in obstacles],
    }
    return _PAGE.replace("@TITLE@", html.escape(title)).replace("@DATA@", orjson.dumps(data).decode())


ROUND = 33  # points of a circle


def outline_arm(robot: Robot, q: Array) -> Array:
    """The origins of base, joints and tool (k, 3) [m] in the base, at `q` (dof,) [rad]."""
    model = robot.pin_model
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    joints = [data.oMi[joint].translation for joint in range(1, model.njoints)]
    return np.array([np.zeros(3), *joints, data.oMf[robot.frame_id()].translation])


def outline_scene(scene: Scene) -> list[Array]:
    """Lines (k, 3) [m] along the edges of the obstacles, where they stand; through points of a cloud, as wide."""
    spec, dashes = mujoco.MjSpec(), list[Array]()
    for obstacle in scene:
        if isinstance(obstacle, PointCloud):
            across = np.outer([-1.0, 1.0], [obstacle.radius, 0.0, 0.0])
            dashes += list(obstacle.some_points(2_000)[:, np.newaxis] + across)
        else:
            obstacle.add_to(spec.worldbody)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    edges = [
        line @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        for geom in range(model.ngeom)
        for line in _outline_geom(model, geom)
    ]
    return edges + dashes


def _outline_geom(model: mujoco.MjModel, geom: int) -> list[Array]:
    """The lines of a shape in its own axes; of a mesh, those of its bounding box."""
    kind, size = model.geom_type[geom], model.geom_size[geom]
    angle = np.linspace(0.0, 2.0 * np.pi, ROUND)
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(ROUND)])
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return [size[0] * np.roll(circle, axis, axis=1) for axis in range(3)]
    if kind in (mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_CAPSULE):
        half = size[1] + (size[0] if kind == mujoco.mjtGeom.mjGEOM_CAPSULE else 0.0)
        end = np.array([0.0, 0.0, half])
        sides = [size[0] * circle[row] + np.outer([-1.0, 1.0], end) for row in range(0, ROUND - 1, ROUND // 4)]
        return [size[0] * circle + end, size[0] * circle - end, *sides]
    if kind == mujoco.mjtGeom.mjGEOM_PLANE:
        corners = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]]
        return [np.array(corners)]  # a square of 2 m stands for a floor
    centre, extent = model.geom_aabb[geom][:3], model.geom_aabb[geom][3:]
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * extent + centre
    return [corners[[0, 1, 3, 2, 0, 4, 5, 7, 6, 4, 5, 1, 3, 7, 6, 2]]]  # a way along all its edges
