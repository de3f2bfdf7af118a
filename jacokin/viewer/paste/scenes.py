"""Scenes as text: entries of a scene's file, and lines of Python."""

from __future__ import annotations

import numpy as np

from jacokin.model import poses
from jacokin.model.obstacles import Box, Capsule, Cylinder, Floor, Obstacle, Sphere
from jacokin.model.scenes.scene import Scene

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
