"""The target and the answer of a view as Python and as a command line; every option in force is in both."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import JacokinError
from jacokin.ik.options import SolverOptions, default_collision
from jacokin.ik.results import Status
from jacokin.model import poses
from jacokin.model.descriptions.bundled import open_angle
from jacokin.model.descriptions.urdf import find_srdf
from jacokin.model.loading import TIP_OF_BUNDLED
from jacokin.model.obstacles import Box, Capsule, Cylinder, Floor, Obstacle, RobotPart, Sphere
from jacokin.model.poses import FreeAxis
from jacokin.model.robot import Robot
from jacokin.model.scene import Scene
from jacokin.viewer.inspector import FULL_TURN, SAME, Inspector
from jacokin.viewer.view import View

SCENE_FILE = "jacokin_scene.json"
ONLY_PYTHON = ("position_tolerance", "orientation_tolerance", "limit_snap", "max_restarts")
SceneShape = type[Box] | type[Sphere] | type[Capsule] | type[Cylinder] | type[Floor]
SHAPES: tuple[SceneShape, ...] = (Box, Sphere, Capsule, Cylinder, Floor)  # that a scene's file can hold
DEFAULTS = {field.name: field.default for field in fields(SolverOptions)}


def python_text(inspector: Inspector, view: View) -> str:
    """The target and the answer as Python; at its end, `q` is where the arm is."""
    solver, call = inspector.solver, find_call(inspector, view)
    options = solver.verifier.options
    lines = ["import jacokin"]
    arguments = [repr(solver.frame)]
    if solver.tool is not None:
        arguments.append(f"tool={_python_pose(solver.tool)}")
    defaults = {**DEFAULTS, "collision": default_collision(options.scene, options.clearance)}
    for name, default in defaults.items():
        value = getattr(options, name)
        if value != default and name != "scene":
            arguments.append(f"{name}={value!r}")
    if options.scene is not None:
        lines += _python_scene(options.scene)
        arguments.append("scene=scene")
    source = inspector.robot.source
    loading = [repr(source.bundled or str(source.path)), *(python for python, _ in _robot_options(inspector.robot))]
    lines.append(f"robot = jacokin.load_robot({', '.join(loading)})")
    lines.append(f"solver = jacokin.IKSolver(robot, {', '.join(arguments)})")
    lines.append(f"target = {_python_pose(view.gizmo if call.free else view.target)}")
    if call.free and view.free is not None:
        span = [view.free.lower, view.free.upper]
        limited = "" if tuple(span) == FULL_TURN else f", range={span}"
        lines.append(f"target = jacokin.FreeAxis(target, axis={_axis_vector(view.free.axis)}{limited})")
    lines.append(f"seed = {call.seed.tolist()}")
    if call.branch is not None:
        lines.append("branches = solver.solve_all(target, seed=seed)")
        lines.append(f"q = branches.q[{call.branch}]  # {_state(view)}")
    else:
        prefer = "" if call.prefer == "nearest" else f", prefer={call.prefer!r}"
        lines.append(f"result = solver.solve(target, seed=seed{prefer})")
        lines.append(f"q = result.q  # {_state(view)}")
    return "\n".join(lines) + "\n"


def command_text(inspector: Inspector, view: View) -> str:
    """The target as a command line; a scene is written to a file first, and what it has no option for is named."""
    solver, source, call = inspector.solver, inspector.robot.source, find_call(inspector, view)
    options = solver.verifier.options
    words = ["jacokin", "ik", "--robot", source.bundled or str(source.path), "--frame", solver.frame]
    if solver.tool is not None:
        words += ["--tool", *_texts(solver.tool.translation), *_texts(poses.quaternion(solver.tool.rotation))]
    words += [word for _, some in _robot_options(inspector.robot) for word in some]
    words += _command_target(view, call)
    words += ["--seed", *_texts(call.seed), "--collision", options.collision]
    words += ["--all"] if call.branch is not None else ["--prefer", call.prefer]
    changed = {name: getattr(options, name) for name in DEFAULTS if getattr(options, name) != DEFAULTS[name]}
    for name in ("method", "qp_solver"):  # which the command line has, too
        if name in changed:
            words += [f"--{name.replace('_', '-')}", changed[name]]
    if options.clearance:
        words += ["--clearance", repr(options.clearance)]
    notes = [f"# {_state(view)}; row {call.branch + 1} of the table\n" if call.branch is not None else ""]
    if own := [f"{name}={changed[name]!r}" for name in ONLY_PYTHON if name in changed]:
        notes.append(f"# there are no options for {', '.join(own)}\n")
    if options.scene is not None:
        words += ["--scene", SCENE_FILE]
        notes.append(_command_scene(options.scene))
    return "".join(notes) + shlex.join(words) + "\n"


def _command_target(view: View, call: SolveCall) -> list[str]:
    """The words of a command line that say where the tool should be."""
    place = view.gizmo if call.free else view.target
    words = ["--position", *_texts(place.translation), "--quat-wxyz", *_texts(poses.quaternion(place.rotation))]
    if call.free and view.free is not None:
        words += ["--free-axis", "xyz"[view.free.axis or 0]]
        if (view.free.lower, view.free.upper) != FULL_TURN:
            words += ["--free-range", *_texts([view.free.lower, view.free.upper])]
    return words


def _command_scene(scene: Scene) -> str:
    """The lines of a shell that write a scene to its file."""
    entries, left_out = _describe(scene)
    rows = ",\n".join(json.dumps(entry) for entry in entries)
    content = f'{{"finger_angle": {json.dumps(scene.finger_angle)}, "obstacles": [\n{rows}\n]}}'
    lines = f"cat > {SCENE_FILE} <<'END'\n{content}\nEND\n"
    return lines + (f"# left out, as no text can hold them: {', '.join(left_out)}\n" if left_out else "")


@dataclass(frozen=True, slots=True, eq=False)
class SolveCall:
    """A call that gives the configuration on the screen."""

    seed: Array
    """(dof,) [rad]."""
    prefer: str
    """Which configuration."""
    free: bool
    """Whether the target may turn about its free axis."""
    branch: int | None = None
    """The number of the branch among all of them; None for the answer of `solve`."""


def find_call(inspector: Inspector, view: View) -> SolveCall:
    """The call whose answer is on the screen, found by trying."""
    turns = view.free is not None and view.free.axis is not None
    reached = view.status is Status.OK or view.selected is not None
    seeds = [view.q, view.seed] if reached else [view.seed]
    for free in (True, False) if turns else (False,):
        for prefer in dict.fromkeys((inspector.prefer, "nearest")):
            for seed in seeds:
                call = SolveCall(seed, prefer, free)
                if inspector.robot.within_limits(seed) and _gives(inspector, view, call):
                    return call
    if len(view.branches) and inspector.solver.dimension() == 0:
        found = inspector.solver.solve_all(view.target, view.seed)
        apart = np.abs(found.q - view.q).max(axis=1)
        if len(apart) and apart.min() < SAME:
            return SolveCall(view.seed, "nearest", free=False, branch=int(np.argmin(apart)))
    return SolveCall(view.seed, "nearest", free=False)


def _gives(inspector: Inspector, view: View, call: SolveCall) -> bool:
    """Whether a call gives the configuration on the screen."""
    target: pin.SE3 | FreeAxis = _as_read(view.target)
    if call.free and view.free is not None:
        span = view.free.lower, view.free.upper
        target = FreeAxis(_as_read(view.gizmo), axis=_axis_vector(view.free.axis), range=span)
    try:
        result = inspector.solver.solve(target, call.seed, prefer=call.prefer)
    except JacokinError:
        return False
    return bool(np.abs(result.q - view.q).max() < SAME)


def _as_read(place: pin.SE3) -> pin.SE3:
    """A pose as it comes out of the text: a quaternion rounds, which decides between equal branches."""
    return poses.pose(place.translation, quat_wxyz=poses.quaternion(place.rotation))


def _robot_options(robot: Robot) -> list[tuple[str, list[str]]]:
    """What the robot was loaded with: each as an argument of `load_robot`, and as words of the command line."""
    source, angle = robot.source, robot.finger_angle
    measured = None if source.calibration is None else source.calibration.path
    srdf = None if source.disabled is None else source.disabled.path
    pairs = ", ".join(f"{joint!r}: ({_number(low)}, {_number(high)})" for joint, low, high in source.limits)
    folders = [str(folder) for folder in source.package_dirs]
    given = (  # argument and what it is, option and what it is each time; none for what was not given
        (f"base={source.base!r}", "--base", _text(source.base)),
        (
            f"tip={source.tip!r}",
            "--tip",
            _text(source.tip, None if source.bundled is None else TIP_OF_BUNDLED),
        ),
        (
            f"finger_angle={angle!r}",
            "--finger-angle",
            [repr(angle)] if angle != (None if source.bundled is None else open_angle(source.bundled)) else [],
        ),
        (f"limits={{{pairs}}}", "--limit", [f"{joint}={low!r},{high!r}" for joint, low, high in source.limits]),
        (f"locked={dict(source.locked)!r}", "--lock", [f"{joint}={value!r}" for joint, value in source.locked]),
        (f"srdf={str(srdf)!r}", "--srdf", _text(srdf, find_srdf(source.path))),
        (f"calibration={str(measured)!r}", "--calibration", _text(measured)),
        (f"package_dirs={folders}", "--package-dir", folders),
    )
    return [(python, [word for text in texts for word in (flag, text)]) for python, flag, texts in given if texts]


def _text(value: object, usual: object = None) -> list[str]:
    """A value as a word; no word for none, and for the usual one."""
    return [] if value is None or value == usual else [str(value)]


def _python_scene(scene: Scene) -> list[str]:
    """The lines that make a scene."""
    entries, left_out = _describe(scene)
    kinds = sorted({str(entry["shape"]).capitalize() for entry in entries})
    lines = [f"from jacokin.ik import {', '.join([*kinds, 'Scene'])}"]
    lines += [f"# left out, as no text can say what it is: {name}" for name in left_out]
    lines.append("scene = Scene([")
    for entry in entries:
        given = [repr(value) for key, value in entry.items() if key not in ("shape", "quat_wxyz")]
        if "quat_wxyz" in entry:
            given[-1] = f"jacokin.pose({given[-1]}, quat_wxyz={entry['quat_wxyz']!r})"
        lines.append(f"    {str(entry['shape']).capitalize()}({', '.join(given)}),")
    angle = scene.finger_angle
    lines.append("])" if angle is None else f"], finger_angle={angle!r})")
    return lines


def _describe(scene: Scene) -> tuple[list[dict[str, object]], list[str]]:
    """The obstacles as in a scene's file, and the names of those that have no place in one."""
    entries, left_out = [], [robot.name for robot in scene.robots]
    for obstacle in scene:
        kind = next((kind for kind in SHAPES if isinstance(obstacle, kind)), None)
        if isinstance(obstacle, RobotPart):
            continue
        if kind is None:
            left_out.append(obstacle.name)
        else:
            entries.append(_entry(obstacle, kind))
    return entries, left_out


def _entry(obstacle: Obstacle, kind: SceneShape) -> dict[str, object]:
    """An obstacle as in a scene's file: its shape, and its fields in order."""
    entry: dict[str, object] = {"shape": kind.__name__.lower()}
    for field in (each for each in fields(kind) if each.init):
        value = getattr(obstacle, field.name)
        if field.name == "pose":
            place = poses.checked_pose(value)
            entry["position"] = place.translation.tolist()
            entry["quat_wxyz"] = poses.quaternion(place.rotation).tolist()
        else:
            entry[field.name] = value.tolist() if isinstance(value, np.ndarray) else value
    return entry


def _axis_vector(axis: int | None) -> list[float]:
    """(3,) the axis x, y or z of the tool by its number."""
    return [1.0 if index == axis else 0.0 for index in range(3)]


def _python_pose(place: pin.SE3) -> str:
    quat = poses.quaternion(place.rotation).tolist()
    return f"jacokin.pose({place.translation.tolist()}, quat_wxyz={quat})"


def _number(value: float) -> str:
    """A number as Python, infinity included."""
    return repr(value) if math.isfinite(value) else f"float({str(value)!r})"


def _texts(values: Iterable[float]) -> list[str]:
    return [repr(float(value)) for value in values]


def _state(view: View) -> str:
    """Whether the arm on the screen reaches the target, or why not."""
    if view.status is not Status.OK:
        return view.status.name.replace("_", " ").lower()
    return "reached" if max(view.errors) < SAME else "the target; the arm on the screen is still on its way"
