"""What touches along a motion by MuJoCo's own distances, with what the arm holds: nothing of the planners' contact."""

from __future__ import annotations

import itertools

import mujoco
import numpy as np

from jacokin import Robot
from jacokin.arrays import Array
from jacokin.model import Scene
from jacokin.model.mujoco_twin import body_of_joint, to_spec
from jacokin.model.obstacles import place, pose_of

STEP = 2e-3  # [rad] no joint moves farther between two places that are looked at
FAR = 0.02  # [m] larger distances are this one
APART = 1e-5  # [m] from there on a pair no longer touches
ROUNDING = 1e-6  # [m] distances of MuJoCo's are known this well
Pair = tuple[str, str]


class Referee:
    """Distances of the shapes of a scene to the moving shapes of an arm, and of what it holds to all others.

    Attributes:
        pairs: the names of each.
    """

    def __init__(self, robot: Robot, scene: Scene, *, opening: float | None = None) -> None:
        """Compile it, with the fingers as the scene has them, or at an opening [rad], or [m]."""
        spec = to_spec(robot, geometry=True, finger_angle=scene.finger_angle if opening is None else opening)
        for obstacle in scene.obstacles:
            obstacle.add_to(spec.worldbody)
        for each in scene.attached:
            frame = robot.pin_model.frames[robot.frame_id(each.to)]
            shape = place(each.shape, frame.placement * pose_of(each.shape))
            shape.add_to(spec.body(body_of_joint(frame.parentJoint)))
        self._model = model = spec.compile()
        self._data = mujoco.MjData(model)
        names = [model.geom(k).name for k in range(model.ngeom)]
        body = model.body_weldid[model.geom_bodyid]
        held = [names.index(each.name) for each in scene.attached]
        obstacles = [names.index(name) for name in scene.names]
        arm = [k for k in range(model.ngeom) if k not in held and k not in obstacles]
        numbers = [(a, b) for a in obstacles for b in (*arm, *held) if body[b] != 0]
        numbers += [(a, b) for a in held for b in arm if body[a] != body[b]]
        self.pairs: list[Pair] = [(names[a], names[b]) for a, b in numbers]
        self._numbers = np.array(numbers, dtype=np.intp).reshape(-1, 2)
        self._reach = model.geom_rbound[self._numbers].sum(axis=1) + FAR

    def distances(self, rows: Array) -> Array:
        """(n, pairs) at configurations (n, dof) [m]."""
        model, data, numbers = self._model, self._data, self._numbers
        found = np.full((len(rows), len(numbers)), FAR)
        for row, q in enumerate(rows):
            data.qpos[:] = q
            mujoco.mj_kinematics(model, data)
            apart = np.linalg.norm(data.geom_xpos[numbers[:, 0]] - data.geom_xpos[numbers[:, 1]], axis=1)
            for k in np.flatnonzero(apart < self._reach).tolist():
                found[row, k] = mujoco.mj_geomDistance(model, data, *numbers[k].tolist(), FAR, None)
        return found

    def contacts(self, rows: Array) -> dict[Pair, float]:
        """Pairs that touch somewhere along straight motions through configurations (n, dof), and how deep [m].

        Pairs that touch at the first one do not count as long as they are nowhere nearer than there, and stay apart
        once they are.
        """
        found = dict[Pair, float]()
        for pair, along in zip(self.pairs, self.distances(densely(rows)).T, strict=True):
            first, apart = float(along[0]), np.flatnonzero(along > APART)
            near = len(along) if not len(apart) else int(apart[0])  # rows until it is apart
            if (along[:near] < first - ROUNDING).any() or (along[near:] <= 0.0).any():
                found[pair] = float(along.min())
        return found


def densely(rows: Array) -> Array:
    """Configurations on the straight motions through some (n, dof), no joint more than `STEP` from one to the next."""
    parts = [rows[:1]]
    for start, end in itertools.pairwise(rows):
        count = int(np.ceil(np.abs(end - start).max() / STEP))
        parts.append(start + (end - start) * np.linspace(0.0, 1.0, count + 1)[1:, None])
    return np.vstack(parts)
