"""A picture of the arm and of a motion, as PNG: `python -m jacokin.cli.picture jaco.png motion.npz`.

MuJoCo needs MUJOCO_GL=egl or osmesa where there is no display.
"""

from __future__ import annotations

import struct
import sys
import zlib
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.model import DEFAULT_ROBOT, urdf_folder

WIDTH, HEIGHT = 960, 720  # [pixel]
SMOOTHING = 2  # rendered larger by this factor and averaged: MuJoCo's own smoothing is missing in software renderers
FINGERS = 0.6  # [rad] half closed
CAMERA = {"elevation": -15.0, "distance": 1.5}  # [deg], [m]
GHOST = 0.5  # opacity of where else the arm was
CRATE = (0.72, 0.55, 0.36, 1.0)  # cardboard


def render(
    q: ArrayLike,
    robot: str = DEFAULT_ROBOT,
    crates: Sequence[tuple[ArrayLike, ArrayLike]] = (),
    *,
    azimuth: float = 60.0,
    look_at: ArrayLike = (0.05, -0.1, 0.42),  # [m]
) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Draw a bundled arm, and where else it was.

    Args:
        q: (6,) or (k, 6) [rad]; of several the first is drawn as it is, the others more transparent one after another.
        robot: name of the arm.
        crates: size (3,) and position (3,) of boxes beside it [m].
        azimuth: of the camera [deg].
        look_at: (3,) what is in the middle [m].

    Returns:
        A picture (HEIGHT, WIDTH, 3), and a mask (HEIGHT, WIDTH): True on the arm.
    """
    spec = scene(robot)
    for size, position in crates:
        half = 0.5 * np.asarray(size, dtype=float)
        box = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=half, pos=np.asarray(position, dtype=float))
        box.rgba = CRATE
    model = spec.compile()
    own = model.geom_bodyid != 0
    data, *ghosts = (_placed(model, row) for row in np.atleast_2d(np.asarray(q, dtype=float)))
    camera = mujoco.MjvCamera()
    camera.lookat[:], camera.azimuth = look_at, azimuth
    for name, value in CAMERA.items():
        setattr(camera, name, value)
    with mujoco.Renderer(model, SMOOTHING * HEIGHT, SMOOTHING * WIDTH) as renderer:
        renderer.update_scene(data, camera)
        for number, ghost in enumerate(ghosts, start=1):
            before = renderer.scene.ngeom
            moved = int(mujoco.mjtCatBit.mjCAT_DYNAMIC)
            mujoco.mjv_addGeoms(model, ghost, mujoco.MjvOption(), mujoco.MjvPerturb(), moved, renderer.scene)
            for geom in renderer.scene.geoms[before : renderer.scene.ngeom]:
                geom.rgba[3] *= GHOST * (1.0 - number / (len(ghosts) + 1.0))
        fine = renderer.render().reshape(HEIGHT, SMOOTHING, WIDTH, SMOOTHING, 3)
        picture = fine.mean(axis=(1, 3)).astype(np.uint8)
        renderer.enable_segmentation_rendering()
        renderer.update_scene(data, camera)
        objects = renderer.render()[::SMOOTHING, ::SMOOTHING, 0]
    return picture, (objects >= 0) & own[objects]


def _placed(model: mujoco.MjModel, q: NDArray[np.float64]) -> mujoco.MjData:
    """The arm at q (6,) [rad], its fingers half closed."""
    data = mujoco.MjData(model)
    for index, angle in enumerate(q, start=1):
        data.joint(f"joint_{index}").qpos[0] = angle
    for joint in range(model.njnt):
        if model.joint(joint).name.startswith("finger"):
            data.joint(joint).qpos[0] = np.clip(FINGERS, *model.jnt_range[joint])
    mujoco.mj_forward(model, data)
    return data


def scene(robot: str = DEFAULT_ROBOT) -> mujoco.MjSpec:
    """A bundled arm on a floor, with light and sky."""
    spec = mujoco.MjSpec.from_file(str(urdf_folder() / f"{robot}.xml"))
    spec.visual.global_.offwidth, spec.visual.global_.offheight = SMOOTHING * WIDTH, SMOOTHING * HEIGHT
    spec.visual.quality.shadowsize = 4096
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = (0.5, 0.5, 0.5), (0.6, 0.6, 0.6)
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=(0.95, 0.96, 0.98),
        rgb2=(0.75, 0.80, 0.87),
        width=256,
        height=256,
    )
    floor = spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0.0, 0.0, 0.05))
    floor.rgba = (0.62, 0.64, 0.67, 1.0)
    light = spec.worldbody.add_light(pos=(0.8, -1.0, 2.5), dir=(-0.3, 0.4, -1.0))
    light.diffuse = (0.5, 0.5, 0.5)
    return spec


def write_png(path: Path, picture: NDArray[np.uint8]) -> None:
    """Write a picture (height, width, 3) as PNG, which needs nothing but zlib."""
    height, width, _ = picture.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), picture.reshape(height, -1)], axis=1)  # 0: no filter

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)  # 8 bits a channel, RGB
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(rows.tobytes()))
        + chunk(b"IEND", b"")
    )


def main(words: list[str]) -> None:
    """Draw a motion: the file, and one with rows q (k, 6) [rad], size and position of a crate [m]."""
    shown = np.load(words[1])
    picture, _ = render(shown["q"], crates=[(shown["size"], shown["position"])], azimuth=140.0, look_at=(0.2, 0.0, 0.3))
    write_png(Path(words[0]), picture)


if __name__ == "__main__":
    main(sys.argv[1:])
