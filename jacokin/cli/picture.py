"""A picture of the arm, as PNG: `python -m jacokin.cli.picture jaco.png 4.8 2.92 1.0 4.2 1.45 1.32`.

MuJoCo needs MUJOCO_GL=egl or osmesa where there is no display.
"""

from __future__ import annotations

import struct
import sys
import zlib
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.model import DEFAULT_ROBOT, urdf_folder

WIDTH, HEIGHT = 960, 720  # [pixel]
SMOOTHING = 2  # rendered larger by this factor and averaged: MuJoCo's own smoothing is missing in software renderers
FINGERS = 0.6  # [rad] half closed
CAMERA = {"azimuth": 60.0, "elevation": -15.0, "distance": 1.5}  # [deg], [deg], [m]
LOOK_AT = (0.05, -0.1, 0.42)  # [m]


def render(q: ArrayLike, robot: str = DEFAULT_ROBOT) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Picture (HEIGHT, WIDTH, 3) of a bundled arm at q (6,) [rad], and a mask (HEIGHT, WIDTH): True on the arm."""
    model = scene(robot).compile()
    data = mujoco.MjData(model)
    for index, angle in enumerate(np.asarray(q, dtype=float), start=1):
        data.joint(f"joint_{index}").qpos[0] = angle
    for joint in range(model.njnt):
        if model.joint(joint).name.startswith("finger"):
            data.joint(joint).qpos[0] = FINGERS
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat[:] = LOOK_AT
    for name, value in CAMERA.items():
        setattr(camera, name, value)
    with mujoco.Renderer(model, SMOOTHING * HEIGHT, SMOOTHING * WIDTH) as renderer:
        renderer.update_scene(data, camera)
        fine = renderer.render().reshape(HEIGHT, SMOOTHING, WIDTH, SMOOTHING, 3)
        picture = fine.mean(axis=(1, 3)).astype(np.uint8)
        renderer.enable_segmentation_rendering()
        renderer.update_scene(data, camera)
        objects = renderer.render()[::SMOOTHING, ::SMOOTHING, 0]
    floor = model.geom("floor").id
    return picture, (objects >= 0) & (objects != floor)


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
    """Draw the arm: the file and the joint angles [rad]."""
    picture, _ = render([float(word) for word in words[1:]])
    write_png(Path(words[0]), picture)


if __name__ == "__main__":
    main(sys.argv[1:])
