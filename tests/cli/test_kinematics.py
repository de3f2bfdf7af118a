"""`jacokin fk` and `jacokin jacobian` agree with Python."""

from __future__ import annotations

import numpy as np

import jacokin
from jacokin import Robot
from tests.cli.run import HOME, Run


def test_fk_agrees_with_python_and_takes_negative_angles(run: Run) -> None:
    q = [-1.2, 2.9, 1.0, -4.2, -0.5, 1.3]
    document = run("fk", *(str(angle) for angle in q), "--json").document
    pose = jacokin.load_robot().forward_kinematics(q)
    assert document["position"] == pose.translation.tolist()
    assert document["within_limits"] is True
    again = jacokin.pose(document["position"], document["quat_wxyz"])
    assert np.allclose(again.rotation, pose.rotation, rtol=0.0, atol=1e-15)
    again = jacokin.pose(document["position"], rpy=document["rpy"])
    assert np.allclose(again.rotation, pose.rotation, rtol=0.0, atol=1e-15)


def test_fk_of_the_documented_home_pose(run: Run) -> None:
    # Kinova's documentation: 275.0 167.4 57.4 241.0 82.7 75.5 deg; its driver: (0.2123, -0.2572, 0.5096) m.
    document = run("fk", "275.0", "167.4", "57.4", "241.0", "82.7", "75.5", "--degrees", "--json").document
    published = [0.212322831154, -0.257197618484, 0.509646713734]
    assert np.linalg.norm(np.array(document["position"]) - published) < 4e-3


def test_fk_says_which_joint_breaks_its_limits(run: Run) -> None:
    assert "broken by joint_2" in run("fk", "0", "0", "3", "0", "0", "0").out


def test_jacobian_agrees_with_python(robot: Robot, run: Run) -> None:
    words = ("jacobian", *HOME, "--frame", "gripsite", "--reference", "local", "--json")
    document = run(*words).document
    q = [float(angle) for angle in HOME]
    assert document["jacobian"] == robot.jacobian(q, "gripsite", "local").tolist()
    assert document["manipulability"] == robot.manipulability(q, "gripsite")


def test_limits_and_fingers_of_ones_own(run: Run) -> None:
    assert "broken by joint_1" in run("fk", *HOME, "--limit", "joint_1=0,1").out
    tips = [
        run("fk", *HOME, "--frame", "link_finger_tip_1", "--finger-angle", angle, "--json").document["position"]
        for angle in ("0.2", "1.2")
    ]
    assert np.linalg.norm(np.subtract(*tips)) > 0.01  # [m]


def test_joints_off_the_arm_are_locked_with_an_option(run: Run) -> None:
    def place(*words: str) -> list[float]:
        position: list[float] = run("fk", *HOME, "--frame", "link_finger_tip_1", "--json", *words).document["position"]
        return position

    assert place("--lock", "finger_1=1.2") == place("--finger-angle", "1.2") != place()
    for words, message in (("finger_1", "--lock must be JOINT=VALUE"), ("finger_9=1", "unknown joint 'finger_9'")):
        assert message in run("fk", *HOME, "--lock", words, code=2).err
