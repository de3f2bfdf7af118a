"""Grasps: the object is between the pads, the hand clears it, and the tables are those of the shapes."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import Robot
from jacokin.errors import InvalidInputError
from jacokin.ik import Box, Cylinder, Obstacle, Scene, Sphere
from jacokin.model.gripper import JACO
from jacokin.model.mujoco_twin import to_spec
from jacokin.model.obstacles import place, pose_of
from jacokin.motion import Grasp, grasps

PLACE = jacokin.pose([0.4, -0.2, 0.3], rpy=[0.1, 0.2, 0.3])


def test_the_room_between_the_pads_is_that_of_the_shapes(robot: Robot) -> None:
    """Half the distance between the thumb's pad and the others, by MuJoCo, at each angle of the table."""
    for angle, half in zip(JACO.openings, 0.5 * JACO.widths, strict=True):
        model = to_spec(robot, geometry=True, finger_angle=float(angle)).compile()
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        pads = [model.geom(f"link_finger_tip_{k}_pad").id for k in (1, 2, 3)]
        gaps = [mujoco.mj_geomDistance(model, data, pads[0], pad, 1.0, None) for pad in pads[1:]]
        across = [robot.forward_kinematics(np.zeros(6)).actInv(data.geom_xpos[pad])[0] for pad in pads]
        assert half <= 0.5 * (across[0] - across[1]) - 0.008
        assert min(gaps) >= 2.0 * half - 0.03


@pytest.mark.parametrize(
    ("found", "shape", "width"),
    [
        (grasps.box([0.06, 0.2, 0.1], PLACE), Box("it", [0.06, 0.2, 0.1], PLACE), 0.06),
        (grasps.cylinder(0.03, 0.15, PLACE), Cylinder("it", 0.03, 0.15, PLACE), 0.06),
        (grasps.sphere(0.03, PLACE.translation), Sphere("it", 0.03, PLACE.translation), 0.06),
    ],
)
def test_the_object_is_between_the_pads(robot: Robot, found: list[Grasp], shape: Obstacle, width: float) -> None:
    """At each grasp the tool's origin is in the object, and no shape of the open hand is."""
    assert len(found) >= 4
    q = robot.home
    for grasp in found[:: max(1, len(found) // 8)]:
        for share in (0.0, 0.5, 1.0):
            low, high = grasp.target.range
            T_base_tool = grasp.target.at(low + share * (high - low))
            T_base_hand = robot.forward_kinematics(q)
            moved = Scene([_moved(shape, T_base_hand * T_base_tool.inverse())], finger_angle=grasp.opening)
            assert float(robot.clearance(q, moved)) > 0.0
            inside = Scene([_moved(shape, T_base_hand * T_base_tool.inverse())])
            assert float(robot.clearance(q, inside.with_fingers(1.35))) < 0.0  # closed fingers are in it
    assert JACO.opening_for(width) == pytest.approx(found[0].opening)


def _moved(shape: Obstacle, move: pin.SE3) -> Obstacle:
    return place(
        shape, (move * pose_of(shape)) if not isinstance(shape, Sphere) else move.act(pose_of(shape).translation)
    )


def test_too_large_for_the_hand() -> None:
    with pytest.raises(InvalidInputError, match=r"the shortest edge, 0.2 m, is more than the hand spans, 0.082 m"):
        grasps.box([0.2, 0.3, 0.2], PLACE)
    with pytest.raises(InvalidInputError, match=r"0.4 m is more than the hand spans"):
        grasps.sphere(0.2, [0, 0, 0])
    with pytest.raises(InvalidInputError, match="radius must be"):
        grasps.cylinder(-1.0, 0.1, PLACE)
