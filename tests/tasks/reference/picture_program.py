"""Run by `test_pictures` in a process that can render: specifications of vision tasks, and pictures of both sides.

Arguments: names of tasks. Prints one line of JSON for each.
"""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

import jacokin.tasks
from tests.tasks.reference.sides import load_reference, specifications, take_over

SIZE = 84
CAMERA = "front_close"
CHANGED = 8  # levels of 255 from which a pixel counts as different


def camera(model: Any, index: int) -> list[float]:
    """Where a camera is, how it looks, and its field of view."""
    return [*model.cam_pos[index].tolist(), *model.cam_quat[index].tolist(), float(model.cam_fovy[index])]


def hide_robot(model: Any, name_of: Callable[[int], str]) -> None:
    """Draw neither the arm nor the hand, nor their shadows."""
    for index in range(model.ngeom):
        if name_of(int(model.geom_bodyid[index])).startswith("jaco_arm/"):
            model.geom_matid[index], model.geom_rgba[index, 3] = -1, 0.0


def changed(one: Any, other: Any) -> float:
    """Share of the pixels that differ."""
    return float((np.abs(one.astype(int) - other).max(axis=-1) > CHANGED).mean())


def compare(name: str) -> dict[str, Any]:
    """Both sides of one task in the same state."""
    # Theirs first: dm_control takes its context to be current still after another library has made one.
    reference = load_reference(name, seed=3)
    step = reference.reset()
    theirs, model = reference.physics, reference.physics.model
    index = model.name2id(CAMERA, "camera")
    hide_robot(model, lambda body: model.id2name(body, "body"))
    wanted = [step.observation[CAMERA][0], theirs.render(height=SIZE, width=SIZE, camera_id=index)]

    ours = jacokin.tasks.load(name, seed=0, contact="dm_control")
    ours.reset()
    ours._episode.goal = take_over(reference, ours)
    own = ours.physics.model
    found = [ours._observation()[CAMERA][0]]
    hide_robot(own, lambda body: own.body(body).name)
    found.append(ours._observation()[CAMERA][0])
    return {
        "name": name,
        "specifications": [specifications(reference), specifications(ours)],
        "cameras": [camera(model, index), camera(own, own.camera(CAMERA).id)],
        "changed": changed(wanted[0], found[0]),
        "changed without robot": changed(wanted[1], found[1]),
        "robot": changed(*wanted),
    }


if __name__ == "__main__":
    warnings.simplefilter("ignore")  # dm_control's, when it looks for back ends
    for task in sys.argv[1:]:
        print(json.dumps(compare(task)), flush=True)
