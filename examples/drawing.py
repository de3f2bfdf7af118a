"""Draw arms with MuJoCo: one solid, others as ghosts, with obstacles, lines, axes and words. The tutorials use it.

from examples.drawing import draw
draw("home.png", robot.home)

Without a display, MuJoCo needs MUJOCO_GL=egl or osmesa.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from jacokin.cli.picture import FINGERS, scene
from jacokin.model.obstacles import Floor, Obstacle

WIDTH, HEIGHT = 640, 480  # [pixel]
SMOOTHING = 2  # rendered larger by this factor and averaged
GHOST = (0.25, 0.5, 0.9, 0.08)
OBSTACLE = (0.85, 0.65, 0.35, 1.0)
LINE = (0.9, 0.3, 0.1, 1.0)
ELLIPSOID = (0.9, 0.3, 0.1, 0.45)
AXES = ((0.8, 0.1, 0.1, 1.0), (0.1, 0.6, 0.1, 1.0), (0.1, 0.2, 0.8, 1.0))  # x, y, z
THICKNESS = 0.004  # [m] radius of a line
LOOK_AT = (0.05, -0.12, 0.35)  # [m]
LEVEL = -15.0  # [deg] elevation of the camera
DISTANCE = 1.5  # [m] of the camera
COLOURS = 48  # of a moving picture


def draw(
    file: str | Path,
    q: ArrayLike,
    *,
    ghosts: ArrayLike = (),
    obstacles: Iterable[Obstacle] = (),
    line: ArrayLike = (),
    axes: Iterable[NDArray[np.float64]] = (),
    words: Iterable[tuple[str, ArrayLike]] = (),
    ellipsoids: Iterable[tuple[ArrayLike, ArrayLike]] = (),
    azimuth: float = 60.0,
    elevation: float = LEVEL,
    distance: float = DISTANCE,
    look_at: Sequence[float] = LOOK_AT,
    robot: str = "j2n6s300",
) -> None:
    """Write a picture as PNG.

    Args:
        file: where to.
        q: (6,) joint angles of the solid arm [rad].
        ghosts: (n, 6) joint angles of translucent arms [rad].
        obstacles: shapes around the arm.
        line: (n, 3) points of a line [m].
        axes: poses (4, 4) in the base, drawn as lines of 10 cm: x red, y green, z blue.
        words: texts, each with its place (3,) [m].
        ellipsoids: each a centre (3,) [m] and a matrix (3, n): where that takes the unit sphere [m].
        azimuth: direction that the camera looks in [deg].
        elevation: the same, negative from above [deg].
        distance: of the camera [m].
        look_at: what it looks at [m].
        robot: name of a bundled arm.
    """
    spec = scene(robot)
    spec.visual.global_.offwidth, spec.visual.global_.offheight = SMOOTHING * WIDTH, SMOOTHING * HEIGHT
    spec.visual.quality.shadowsize = 2048
    for obstacle in obstacles:
        if not isinstance(obstacle, Floor):  # one is there
            obstacle.add_to(spec.worldbody)
            spec.geom(obstacle.name).rgba = OBSTACLE
    model = spec.compile()
    camera = mujoco.MjvCamera()
    camera.lookat[:], camera.distance, camera.azimuth, camera.elevation = look_at, distance, azimuth, elevation
    font = mujoco.mjtFontScale.mjFONTSCALE_200
    with mujoco.Renderer(model, SMOOTHING * HEIGHT, SMOOTHING * WIDTH, font_scale=font) as renderer:
        renderer.update_scene(_standing(model, q), camera)
        for ghost in np.reshape(ghosts, (-1, 6)):
            _add_ghost(renderer.scene, model, _standing(model, ghost))
        points = np.reshape(line, (-1, 3))
        for start, end in itertools.pairwise(points):
            _add_line(renderer.scene, start, end, LINE)
        for pose in axes:
            for direction, color in zip(pose[:3, :3].T, AXES, strict=True):
                tip = pose[:3, 3] + 0.1 * direction
                _add_line(renderer.scene, pose[:3, 3], tip, color)
        for centre, matrix in ellipsoids:
            _add_ellipsoid(renderer.scene, centre, matrix)
        for text, place in words:
            _add_word(renderer.scene, text, np.asarray(place, dtype=float))
        save(file, renderer.render(), SMOOTHING)


def save(file: str | Path, picture: NDArray[np.uint8], smoothing: int = 1) -> None:
    """Write a picture (height, width, 3) as a small PNG, shrunk by averaging."""
    height, width, _ = picture.shape
    blocks = picture.reshape(height // smoothing, smoothing, width // smoothing, smoothing, 3)
    image = Image.fromarray(blocks.mean(axis=(1, 3)).astype(np.uint8))
    image.save(file, optimize=True)


def _standing(model: mujoco.MjModel, q: ArrayLike) -> mujoco.MjData:
    """The arm at q, with its fingers half closed."""
    data = mujoco.MjData(model)
    for joint in range(model.njnt):
        data.qpos[joint] = FINGERS if model.joint(joint).name.startswith("finger") else 0.0
    for index, angle in enumerate(np.asarray(q, dtype=float), start=1):
        data.joint(f"joint_{index}").qpos[0] = angle
    mujoco.mj_forward(model, data)
    return data


def _add_ghost(scene: mujoco.MjvScene, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    first = scene.ngeom
    moving = int(mujoco.mjtCatBit.mjCAT_DYNAMIC)
    mujoco.mjv_addGeoms(model, data, mujoco.MjvOption(), mujoco.MjvPerturb(), moving, scene)
    for geom in scene.geoms[first : scene.ngeom]:
        geom.rgba, geom.matid, geom.transparent = GHOST, -1, 1


def _add_line(scene: mujoco.MjvScene, start: ArrayLike, end: ArrayLike, color: Sequence[float]) -> None:
    geom, kind = scene.geoms[scene.ngeom], mujoco.mjtGeom.mjGEOM_CAPSULE
    mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.zeros(9), np.asarray(color, dtype=np.float32))
    mujoco.mjv_connector(geom, kind, THICKNESS, np.asarray(start, dtype=float), np.asarray(end, dtype=float))
    scene.ngeom += 1


def _add_ellipsoid(scene: mujoco.MjvScene, centre: ArrayLike, matrix: ArrayLike) -> None:
    geom, kind = scene.geoms[scene.ngeom], mujoco.mjtGeom.mjGEOM_ELLIPSOID
    axes, sizes, _ = np.linalg.svd(np.asarray(matrix, dtype=float))
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    sizes, place = np.maximum(sizes, THICKNESS), np.asarray(centre, dtype=float)
    mujoco.mjv_initGeom(geom, kind, sizes, place, axes.ravel(), np.asarray(ELLIPSOID, dtype=np.float32))
    geom.transparent = 1
    scene.ngeom += 1


def _add_word(scene: mujoco.MjvScene, text: str, place: NDArray[np.float64]) -> None:
    geom = scene.geoms[scene.ngeom]
    size, rotation = np.full(3, 0.001), np.eye(3).ravel()
    mujoco.mjv_initGeom(geom, mujoco.mjtGeom.mjGEOM_LABEL, size, place, rotation, np.ones(4, np.float32))
    geom.label = text
    scene.ngeom += 1


class Film:
    """A moving picture of a simulation."""

    def __init__(
        self, model: mujoco.MjModel, look_at: ArrayLike = LOOK_AT, *, azimuth: float = 120.0, distance: float = 1.7
    ) -> None:
        """Begin without pictures of a place [m], seen in a direction [deg] from a distance [m]."""
        model.vis.quality.shadowsize = 1024  # of pictures as small as these
        self._renderer = mujoco.Renderer(model, 240, 320)
        self._camera = mujoco.MjvCamera()
        self._camera.lookat[:] = look_at
        self._camera.distance, self._camera.azimuth, self._camera.elevation = distance, azimuth, LEVEL
        self._frames: list[Image.Image] = []

    def take(self, data: mujoco.MjData) -> None:
        """Take one picture."""
        self._renderer.update_scene(data, camera=self._camera)
        self._frames.append(Image.fromarray(self._renderer.render()).quantize(COLOURS))

    def save(self, file: str | Path, seconds: float) -> None:
        """Write a GIF that shows each picture for so long [s]."""
        first, *rest = self._frames
        Path(file).parent.mkdir(parents=True, exist_ok=True)
        first.save(file, save_all=True, append_images=rest, duration=round(1000 * seconds), loop=0)
