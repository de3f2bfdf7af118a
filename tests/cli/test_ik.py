"""`jacokin ik` for one pose: the answer, every branch, free axes, tools and limits, and what happens out of reach."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import Robot
from tests.cli.run import POSE, Run
from tests.gripper_arms import so101_text
from tests.ik.test_few_joints import CHAINS, urdf_of

FAR = ("--position", "9", "9", "9", "--down")


def test_ik_reaches_the_pose_and_its_joints_read_back_exactly(robot: Robot, run: Run) -> None:
    answer = run("ik", *POSE, "--json")
    assert answer.document["status"] == "OK"
    q = np.array(answer.document["q"])
    assert robot.within_limits(q)
    error = robot.forward_kinematics(q).inverse() * jacokin.pose([0.3, -0.2, 0.5], down=True)
    assert np.linalg.norm(error.translation) < 1e-6
    assert np.linalg.norm(error.rotation - np.eye(3)) < 1e-6
    expected = jacokin.IKSolver(robot).solve(jacokin.pose([0.3, -0.2, 0.5], down=True))
    assert q.tolist() == expected.q.tolist()  # not one bit lost on the way


def test_ik_without_an_orientation_leaves_it_free(run: Run) -> None:
    answer = run("ik", "--position", "0.3", "-0.2", "0.5", "--json")
    assert answer.document["method"] == "qp"
    position = jacokin.load_robot().forward_kinematics(answer.document["q"]).translation
    assert np.linalg.norm(position - [0.3, -0.2, 0.5]) < 1e-6


def test_ik_degrees_are_for_angles_in_and_out(run: Run) -> None:
    in_degrees = run("ik", *POSE[:4], "--rpy", "90", "0", "-30", "--degrees", "--json")
    in_radians = run("ik", *POSE[:4], "--rpy", "1.5707963267948966", "0", "-0.5235987755982988", "--json")
    assert in_degrees.document["angle_unit"] == "deg"
    assert np.allclose(np.radians(in_degrees.document["q"]), in_radians.document["q"], rtol=0.0, atol=1e-12)


def test_ik_takes_the_branch_nearest_to_the_seed(run: Run) -> None:
    every = run("ik", *POSE, "--all", "--json").document["branches"]
    within = [branch["q"] for branch in every if branch["within_limits"]]
    assert len(within) >= 2
    for q in within:
        answer = run("ik", *POSE, "--seed", *(repr(angle) for angle in q), "--json")
        assert np.allclose(answer.document["q"], q, rtol=0.0, atol=1e-9)


def test_ik_all_shows_every_branch_with_its_margins(run: Run) -> None:
    branches = run("ik", *POSE, "--all", "--json").document["branches"]
    assert len(branches) >= 2
    assert [branch["distance"] for branch in branches] == sorted(branch["distance"] for branch in branches)
    for branch in branches:
        margins = [margin for margin in branch["limit_margin"] if margin is not None]
        assert (min(margins) >= 0.0) == branch["within_limits"]
    table = run("ik", *POSE, "--all").out
    for name in jacokin.load_robot().joint_names:
        assert name in table


def test_ik_rejects_branches_that_touch(run: Run) -> None:
    branches = run("ik", *POSE, "--all", "--collision", "report", "--json").document["branches"]
    free = [branch["q"] for branch in branches if branch["within_limits"] and not branch["touching"]]
    assert run("ik", *POSE, "--collision", "reject", "--json", code=0 if free else 1).document["touching"] == []


def test_ik_out_of_reach_says_why_and_leaves_with_1(run: Run) -> None:
    answer = run("ik", *FAR, code=1)
    assert "UNREACHABLE" in answer.out
    assert "closest configuration within the limits" in answer.out
    document = run("ik", *FAR, "--json", code=1).document
    assert document["success"] is False
    assert document["position_error"] > 10.0
    assert jacokin.load_robot().within_limits(document["q"])


def test_ik_all_out_of_reach_leaves_with_1(run: Run) -> None:
    assert "UNREACHABLE" in run("ik", *FAR, "--all", code=1).out


def test_ik_all_says_what_solving_once_says_where_it_has_nothing(run: Run, tmp_path: Path) -> None:
    """Angles of this file have five digits, so straight down is missed by some 4e-6 rad."""
    (tmp_path / "so101.urdf").write_text(so101_text())
    pose = ("--robot", str(tmp_path / "so101.urdf"), "--collision", "ignore", "--position", "0.2", "0.1", "0.02")
    yawed = ("ik", *pose, "--rpy", "180", "0", "57", "--degrees")
    once = run(*yawed, code=1).out.splitlines()[0]
    assert "NO_CONVERGENCE" in once
    assert "--orientation-tolerance 1e-5 accepts it" in once
    assert run(*yawed, "--all", code=1).out.splitlines()[0] == once
    accepted = run(*yawed, "--all", "--orientation-tolerance", "1e-5").out
    assert "1 usable" in accepted
    assert "nothing meets this pose exactly; the rows are within the tolerances" in accepted
    down = run("ik", *pose, "--approach", "0", "0", "-1", "--all", "--orientation-tolerance", "1e-5").out
    assert "this pose has a curve of solutions; the rows are members of it" in down
    held = run("ik", *FAR, "--robot", "gen3", "--all", "--fixed", "joint_3=0", code=1).out
    assert "No joint angles reach this pose with these joints held" in held


def test_ik_with_the_qp_and_a_random_seed_repeats(run: Run) -> None:
    words = ("ik", *POSE, "--method", "qp", "--qp-solver", "osqp", "--random-seed", "7", "--json")
    first, second = run(*words).document, run(*words).document
    assert first["qp_solver"] == "osqp"
    assert first["q"] == second["q"]


PLACE = ("ik", "--position", "0.3", "-0.2", "0.3")


def test_an_approach_leaves_the_roll_free(run: Run) -> None:
    assert isinstance(run(*PLACE, "--approach", "1", "0", "0", "--json").document["parameter"], float)


def test_the_angle_about_a_free_axis_is_in_the_unit_of_the_user(run: Run) -> None:
    answer = run(*PLACE, "--down", "--free-axis", "0,1,0", "--free-range", "-20", "20", "--degrees", "--json")
    assert -20.0 <= answer.document["parameter"] <= 20.0


@pytest.mark.parametrize("robot", ["j2n6s300", "j2s7s300"])
def test_all_intervals(run: Run, robot: str) -> None:
    free = ("--free-axis", "x") if robot == "j2n6s300" else ()
    words = ("ik", "--position", "0.4", "-0.2", "0.3", "--down", *free, "--all", "--robot", robot)
    found = run(*words, "--json").document
    assert found["complete"]
    assert all(row["start"] <= row["stop"] for row in found["intervals"])
    assert "intervals of the free parameter" in run(*words).out


TARGET = ("--position", "0.3", "-0.2", "0.4", "--down")


def solved(run: Run, *words: str) -> list[float]:
    answer = run("ik", *TARGET, *words, "--json")
    q: list[float] = answer.document["q"]
    return q


def test_the_tool_reaches_the_target(robot: Robot, run: Run) -> None:
    half = math.sqrt(0.5)
    for words, turn in (
        (("0.01", "0.02", "0.05"), 0.0),
        (("0.01", "0.02", "0.05", f"{half}", f"{half}", "0", "0"), 90.0),
    ):
        q = solved(run, "--tool", *words)
        tool = pin.SE3(pin.rpy.rpyToMatrix(math.radians(turn), 0.0, 0.0), np.array([0.01, 0.02, 0.05]))
        reached = robot.forward_kinematics(q) * tool
        assert reached.isApprox(jacokin.pose([0.3, -0.2, 0.4], down=True), 1e-6)


def test_own_limits_hold(run: Run) -> None:
    free = solved(run)
    high = math.floor(free[1] * 10.0) / 10.0
    held = solved(run, "--limit", f"joint_2=1.0,{high}", "--limit", "joint_6=-inf,3", "--degrees")
    assert math.radians(held[1]) <= high < free[1]


def test_fingers_stand_where_they_are_told(run: Run) -> None:
    assert len(solved(run, "--finger-angle", "1.2", "--collision", "reject")) == 6
    assert "the fingers move from" in run("ik", *TARGET, "--finger-angle", "9", code=2).err


def test_messages_name_options_and_not_pythons_arguments(run: Run, tmp_path: Path) -> None:
    eight = np.insert(CHAINS["seven"], 3, CHAINS["seven"][1], 0)
    for name, chain in (("five", CHAINS["five"]), ("seven", CHAINS["seven"]), ("eight", eight)):
        (tmp_path / f"{name}.urdf").write_text(urdf_of(chain))
    refused = run("ik", *POSE, "--robot", tmp_path / "eight.urdf", "--all", code=2)
    assert refused.err.endswith("this model has 8: --all holds joints at values with --fixed\n")
    seven = ("ik", *POSE, "--robot", str(tmp_path / "seven.urdf"), "--all")
    run(*seven, "--fixed", "joint_3=20", "--degrees", code=(0, 1))
    assert "--fixed must be JOINT=VALUE" in run(*seven, "--fixed", "0.4", code=2).err
    assert "--fixed goes with --all" in run("ik", *POSE, "--fixed", "joint_3=0.4", code=2).err
    about = run("ik", *POSE, "--robot", "j2s7s300", "--free-axis", "z", "--all", code=2)
    assert about.err.startswith("jacokin: --free-axis on seven joints leaves two free parameters")
    arm = jacokin.load_robot(tmp_path / "five.urdf")
    T = arm.forward_kinematics([0.4, -0.5, -1.0, 0.3, 0.8])
    words = [f"{value:.4f}" for value in (*T.translation, *pin.rpy.matrixToRpy(T.rotation))]
    near = ("ik", "--robot", str(tmp_path / "five.urdf"), "--position", *words[:3], "--rpy", *words[3:])
    named = re.findall(r"(--[a-z]+-tolerance) (1e-\d)", run(*near, code=1).out)
    assert named
    run(*near, *(word for option in named for word in option))
