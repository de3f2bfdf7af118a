"""Adds the playground's files to the site while it is built: its scripts, and the shapes of every bundled robot.

The site also opens from a folder, where browsers load neither modules nor other files by `fetch`. So the scripts of
`docs/playground/scripts` become one plain script, the WebAssembly is inside the script of its worker, and each robot
is a script of its own.
"""

from __future__ import annotations

import base64
import gzip
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

import jacokin
from jacokin.arrays import Array
from jacokin.model import NAMES, Robot
from jacokin.viewer.drawing import ArmPart, Triangles, load_parts, merge

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files

HERE = Path(__file__).resolve().parent / "playground" / "scripts"
WEB = HERE.parents[2] / "integrations" / "web"
#: Scripts in the order in which they need each other.
PAGE = ("matrices", "chain", "own", "pace", "stage", "handles", "plot", "code", "link", "panel", "page")
#: Of the shapes' corners, in the files of the robots [m].
STEP = 1e-4
#: Of what is round, where an arm is drawn by few triangles while it moves.
LIGHT_SIDES = 12
IMPORT = re.compile(r'^import [^;]* from "\./[\w.]+";\n', re.M)
EXPORT = re.compile(r"^export (?=(?:async function|function|class|const) (\w+))", re.M)


def on_files(files: Files, /, *, config: MkDocsConfig) -> Files:
    """MkDocs calls this once it has found the files of the site.

    Raises:
        PluginError: the npm package was not built.
    """
    from mkdocs.exceptions import PluginError
    from mkdocs.structure.files import File

    try:
        script = page_script()
    except FileNotFoundError as error:
        advice = "the playground needs the npm package: run `make docs`, or python integrations/web/build.py"
        raise PluginError(advice) from error
    for name, content in {"playground": script, **{name: robot_script(name) for name in NAMES}}.items():
        files.append(File.generated(config, f"playground/{name}.js", content=content))
    return files


def page_script(web: Path = WEB) -> str:
    """The scripts of the page, with that of the worker as a text; `web` is where the npm package was built."""
    worker = [
        f"const WASM = {packed((web / 'jacokin.wasm').read_bytes())};\n",
        *(joined(path) for path in (web / "robots.js", web / "jacokin.js", HERE / "unpack.js", HERE / "worker.js")),
    ]
    page = [joined(HERE / f"{name}.js") for name in ("unpack", *PAGE)]
    head = f"const ROBOTS = {json.dumps(NAMES)};\nconst WORKER = {json.dumps(''.join(worker))};\n"
    return f'(() => {{\n"use strict";\n{head}{"".join(page)}}})();\n'


def joined(path: Path) -> str:
    """A module as a part of a script: its exports are names of the script, which is where its imports are found."""
    text = path.read_text(encoding="utf-8").replace("import.meta.url", "self.location.href")
    body = EXPORT.sub("", IMPORT.sub("", text))
    names = ", ".join(EXPORT.findall(text))
    return f"const {{ {names} }} = (() => {{\n{body}return {{ {names} }};\n}})();\n"


def packed(content: bytes) -> str:
    """A JavaScript string: gzip, as base64."""
    return json.dumps(base64.b64encode(gzip.compress(content, mtime=0)).decode("ascii"))


def robot_script(name: str) -> str:
    """The script that hands a robot to the page."""
    content = json.dumps(describe(jacokin.load_robot(name)), separators=(",", ":")).encode("ascii")
    return f"globalThis.jacokinRobots ??= {{}};\nglobalThis.jacokinRobots[{json.dumps(name)}] = {packed(content)};\n"


def describe(robot: Robot) -> dict[str, Any]:
    """What the page draws and says of a robot: every joint turns about z of its frame."""
    model = robot.pin_model
    kinds = {model.joints[joint].shortname() for joint in range(1, model.njoints)}
    if kinds != {"JointModelRZ"}:
        raise ValueError(f"{robot.name}: the page draws joints about z alone, not {', '.join(sorted(kinds))}")
    frame = model.frames[robot.frame_id()]
    return {
        "name": robot.name,
        "frame": model.frames[robot.frame_id()].name,
        "joints": list(robot.joint_names),
        "placements": [_matrix(model.jointPlacements[joint]) for joint in range(1, model.njoints)],
        "tool": _matrix(frame.placement),
        "lower": _limits(robot.lower),
        "upper": _limits(robot.upper),
        "home": robot.home.tolist(),
        "step": STEP,
        "parts": [
            _part(part, light)
            for part, light in zip(load_parts(robot)[0], load_parts(robot, sides=LIGHT_SIDES)[0], strict=True)
        ],
    }


def _matrix(pose: pin.SE3) -> list[float]:
    """A pose, row by row."""
    return [float(number) for number in pose.homogeneous.ravel()]


def _limits(values: Array) -> list[float | None]:
    """[rad]; None where there is no limit."""
    return [float(value) if np.isfinite(value) else None for value in values]


def _part(part: ArmPart, light: ArmPart) -> dict[str, Any]:
    """What one joint moves: smooth pieces by colour, with many triangles and with few, and the plain shapes as one."""
    plain = merge(list(part.shapes.values()))
    return {
        **{name: _pieces(each) for name, each in (("pieces", part), ("light", light))},
        "plain": None if plain is None else _mesh(plain),
    }


def _pieces(part: ArmPart) -> list[dict[str, Any]]:
    return [{"colour": piece.colour, **_mesh(piece.mesh)} for piece in part.pieces]


def _mesh(mesh: Triangles) -> dict[str, list[int]]:
    vertices = np.round(mesh.vertices / STEP).astype(int)
    return {"vertices": vertices.ravel().tolist(), "faces": mesh.faces.ravel().tolist()}
