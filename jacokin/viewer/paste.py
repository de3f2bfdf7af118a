"""The target and the answer of a view as Python and as a command line; every option in force is in both."""

from __future__ import annotations

import json
import math
import shlex
from dataclasses import dataclass, fields

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import JacokinError
from jacokin.ik.options import Options
from jacokin.ik.results import Branches, Status
from jacokin.model import poses
from jacokin.model.obstacles import Box, Capsule, Cylinder, Floor, Obstacle, Sphere
from jacokin.model.poses import FreeAxis, pose
from jacokin.model.robot import Source
from jacokin.model.scene import Scene
from jacokin.viewer.inspector import FULL_TURN, Inspector
from jacokin.viewer.view import View

SAME = 1e-6  # [rad] an answer this near to the arm on the screen is the same


@dataclass(frozen=True, slots=True, eq=False)
class Call:
    """A call that gives the configuration on the screen."""

    seed: Array
    """(dof,) [rad]."""
    prefer: str
    """Which configuration."""
    free: bool
    """Whether the target may turn about its free axis."""
    branch: int | None = None
    """The number of the branch among all of them; None for the answer of `solve`."""


def call_of(inspector: Inspector, view: View) -> Call:
    """The call whose answer is on the screen, found by trying."""
    turns = view.free is not None and view.free.axis is not None
    reached = view.status is Status.OK or view.selected is not None
    seeds = [view.q, view.seed] if reached else [view.seed]
    for free in (True, False) if turns else (False,):
        for prefer in dict.fromkeys((inspector.prefer, "nearest")):
            for seed in seeds:
                if inspector.robot.within_limits(seed) and _gives(inspector, view, Call(seed, prefer, free)):
                    return Call(seed, prefer, free)
    if len(view.branches):
        found = inspector.solver.solve_all(view.target, view.seed)
        if isinstance(found, Branches) and len(found):
            apart = np.abs(found.q - view.q).max(axis=1)
            if apart.min() < SAME:
                return Call(view.seed, "nearest", free=False, branch=int(np.argmin(apart)))
    return Call(view.seed, "nearest", free=False)


def _gives(inspector: Inspector, view: View, call: Call) -> bool:
    """Whether a call gives the configuration on the screen."""
    target: pin.SE3 | FreeAxis = _as_read(view.target)
    if call.free and view.free is not None:
        target = FreeAxis(
            _as_read(view.gizmo), axis=axis_vector(view.free.axis), range=(view.free.lower, view.free.upper)
        )
    try:
        result = inspector.solver.solve(target, call.seed, prefer=call.prefer)
    except JacokinError:
        return False
    return bool(np.abs(result.q - view.q).max() < SAME)


def _as_read(place: pin.SE3) -> pin.SE3:
    """A pose as it comes out of the text: a quaternion rounds, which decides between equal branches."""
    return pose(place.translation, quat_wxyz=poses.quaternion(place.rotation))


def axis_vector(axis: int | None) -> list[float]:
    """(3,) the axis x, y or z of the tool by its number."""
    return [1.0 if index == axis else 0.0 for index in range(3)]


SIZES = {Box: ("size",), Sphere: ("radius",), Capsule: ("radius", "length"), Cylinder: ("radius", "length")}


def python_scene(scene: Scene) -> list[str]:
    """The lines that make a scene."""
    entries, left_out = entries_of(scene)
    kinds = sorted({str(entry["shape"]).capitalize() for entry in entries})
    lines = [f"from jacokin.ik import {', '.join([*kinds, 'Scene'])}"]
    lines += [f"# left out, as no text can say what it is: {name}" for name in left_out]
    lines.append("scene = Scene([")
    for entry in entries:
        if entry["shape"] == "floor":
            lines.append(f"    Floor({entry['height']!r}, {entry['name']!r}),")
            continue
        place = repr(entry["position"])
        if "quat_wxyz" in entry:
            place = f"jacokin.pose({place}, quat_wxyz={entry['quat_wxyz']!r})"
        sizes = [repr(entry[key]) for key in ("size", "radius", "length") if key in entry]
        lines.append(f"    {str(entry['shape']).capitalize()}({', '.join([repr(entry['name']), *sizes, place])}),")
    angle = scene.finger_angle
    lines.append("])" if angle is None else f"], finger_angle={angle!r})")
    return lines


def entries_of(scene: Scene) -> tuple[list[dict[str, object]], list[str]]:
    """The obstacles as in a scene's file, and the names of those that have no place in one."""
    entries, left_out = [], []
    for obstacle in scene:
        entry = _entry(obstacle)
        if entry is None:
            left_out.append(obstacle.name)
        else:
            entries.append(entry)
    return entries, left_out


def _entry(obstacle: Obstacle) -> dict[str, object] | None:
    """An obstacle as in a scene's file; None for a shape of another program."""
    kind = type(obstacle)
    entry: dict[str, object] = {"shape": kind.__name__.lower(), "name": obstacle.name}
    if isinstance(obstacle, Floor):
        return entry | {"height": obstacle.height}
    if kind not in SIZES:
        return None
    for key in SIZES[kind]:
        value = getattr(obstacle, key)
        entry[key] = value.tolist() if isinstance(value, np.ndarray) else value
    if isinstance(obstacle, Sphere):
        return entry | {"position": np.asarray(obstacle.position).tolist()}
    assert isinstance(obstacle, Box | Capsule | Cylinder)  # those of SIZES
    place = poses.checked_pose(obstacle.pose)
    quat = poses.quaternion(place.rotation).tolist()
    return entry | {"position": place.translation.tolist(), "quat_wxyz": quat}


SCENE_FILE = "jacokin_scene.json"
OF_SOLVER = ("method", "qp_solver")  # options that the command line has too
ONLY_PYTHON = ("position_tolerance", "orientation_tolerance", "limit_snap", "max_restarts")
DEFAULTS = {field.name: field.default for field in fields(Options)}


def python_text(inspector: Inspector, view: View) -> str:
    """The target and the answer as Python; at its end, `q` is where the arm is."""
    solver, call = inspector.solver, call_of(inspector, view)
    options = solver.verifier.options
    lines = ["import jacokin"]
    arguments = [repr(solver.frame)]
    if solver.tool is not None:
        arguments.append(f"tool={_python_pose(solver.tool)}")
    for field in fields(Options):
        value = getattr(options, field.name)
        if value != field.default and field.name != "scene":
            arguments.append(f"{field.name}={value!r}")
    if options.scene is not None:
        lines += python_scene(options.scene)
        arguments.append("scene=scene")
    lines.append(f"robot = jacokin.load_robot({', '.join(_robot_arguments(inspector))})")
    lines.append(f"solver = jacokin.IKSolver(robot, {', '.join(arguments)})")
    place = view.gizmo if call.free else view.target
    lines.append(f"target = {_python_pose(place)}")
    if call.free and view.free is not None:
        free = view.free
        span = "" if (free.lower, free.upper) == FULL_TURN else f", range={[free.lower, free.upper]}"
        lines.append(f"target = jacokin.FreeAxis(target, axis={axis_vector(free.axis)}{span})")
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
    solver, robot, call = inspector.solver, inspector.robot, call_of(inspector, view)
    options, source = solver.verifier.options, robot.source
    words = ["jacokin", "ik", "--robot", source.bundled or str(source.path), "--frame", solver.frame]
    if solver.tool is not None:
        words += ["--tool", *_texts(solver.tool.translation), *_texts(poses.quaternion(solver.tool.rotation))]
    for option, value in (("--base", source.base), ("--tip", _own_tip(source))):
        if value is not None:
            words += [option, value]
    for folder in source.package_dirs:
        words += ["--package-dir", str(folder)]
    for joint, low, high in source.limits:
        words += ["--limit", f"{joint}={low!r},{high!r}"]
    if _own_fingers(inspector):
        words += ["--finger-angle", repr(robot.finger_angle)]
    place = view.gizmo if call.free else view.target
    words += ["--position", *_texts(place.translation), "--quat-wxyz", *_texts(poses.quaternion(place.rotation))]
    if call.free and view.free is not None:
        words += ["--free-axis", "xyz"[view.free.axis or 0]]
        if (view.free.lower, view.free.upper) != FULL_TURN:
            words += ["--free-range", *_texts([view.free.lower, view.free.upper])]
    words += ["--seed", *_texts(call.seed), "--collision", options.collision]
    words += ["--all"] if call.branch is not None else ["--prefer", call.prefer]
    for name in OF_SOLVER:
        if getattr(options, name) != DEFAULTS[name]:
            words += [f"--{name.replace('_', '-')}", getattr(options, name)]
    own = [f"{name}={getattr(options, name)!r}" for name in ONLY_PYTHON if getattr(options, name) != DEFAULTS[name]]
    if options.clearance:
        words += ["--clearance", repr(options.clearance)]
    notes = [f"# {_state(view)}; row {call.branch + 1} of the table\n" if call.branch is not None else ""]
    if own:
        notes.append(f"# there are no options for {', '.join(own)}\n")
    if options.scene is not None:
        entries, left_out = entries_of(options.scene)
        rows = ",\n".join(json.dumps(entry) for entry in entries)
        angle = json.dumps(options.scene.finger_angle)
        content = f'{{"finger_angle": {angle}, "obstacles": [\n{rows}\n]}}'
        notes.append(f"cat > {SCENE_FILE} <<'END'\n{content}\nEND\n")
        words += ["--scene", SCENE_FILE]
        if left_out:
            notes.append(f"# left out, as no file can hold them: {', '.join(left_out)}\n")
    return "".join(notes) + shlex.join(words) + "\n"


def _robot_arguments(inspector: Inspector) -> list[str]:
    """What `load_robot` is given."""
    robot, source = inspector.robot, inspector.robot.source
    arguments = [repr(source.bundled or str(source.path))]
    if source.base is not None:
        arguments.append(f"base={source.base!r}")
    if _own_tip(source) is not None:
        arguments.append(f"tip={source.tip!r}")
    if _own_fingers(inspector):
        arguments.append(f"finger_angle={robot.finger_angle!r}")
    if source.limits:
        pairs = ", ".join(f"{joint!r}: ({_number(low)}, {_number(high)})" for joint, low, high in source.limits)
        arguments.append(f"limits={{{pairs}}}")
    if source.package_dirs:
        arguments.append(f"package_dirs={[str(folder) for folder in source.package_dirs]}")
    return arguments


def _own_tip(source: Source) -> str | None:
    """The tip that was asked for; None for what it is without asking."""
    from jacokin.model.loading import TIP_OF_BUNDLED

    return None if source.bundled is not None and source.tip == TIP_OF_BUNDLED else source.tip


def _own_fingers(inspector: Inspector) -> bool:
    """Whether the fingers stand at another angle than that of a robot loaded without one."""
    from jacokin.model.loading import FINGER_ANGLE

    usual = FINGER_ANGLE if inspector.robot.source.bundled is not None else None
    return inspector.robot.finger_angle != usual


def _python_pose(place: pin.SE3) -> str:
    quat = poses.quaternion(place.rotation).tolist()
    return f"jacokin.pose({place.translation.tolist()}, quat_wxyz={quat})"


def _number(value: float) -> str:
    """A number as Python, infinity included."""
    return repr(value) if math.isfinite(value) else f"float({str(value)!r})"


def _texts(values: Array | list[float]) -> list[str]:
    return [repr(float(value)) for value in values]


def _state(view: View) -> str:
    """What the arm on the screen is to the target."""
    if view.status is not Status.OK:
        return view.status.name.replace("_", " ").lower()
    return "reached" if max(view.errors) < SAME else "the target; the arm on the screen is still on its way"
