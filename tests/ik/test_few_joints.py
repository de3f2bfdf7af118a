"""Arms as their makers publish them: the bound of reach first on every way, and poses in few digits."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import IKSolver, Robot, Status
from jacokin.arrays import Array
from jacokin.errors import StructureError
from jacokin.ik.closest import ReachBound
from jacokin.reachability import build
from tests.kernels.six_joints.arms import chain_of_arm
from tests.robot_files import load_text, serial_urdf

#: Placements (n + 1, 3, 4) by name.
CHAINS = {
    "xarm6": chain_of_arm("xarm6"),
    "offset wrist": chain_of_arm("offset wrist"),
    "five": np.delete(chain_of_arm("xarm6"), 5, 0),
    "four": chain_of_arm("xarm6")[[0, 1, 2, 3, 6]],
    "three": chain_of_arm("xarm6")[[0, 1, 2, 6]],
    "seven": np.insert(chain_of_arm("generic"), 3, chain_of_arm("offset wrist")[4], 0),
}


def urdf_of(chain: Array) -> str:
    """A description of turning joints, 3 rad to both sides."""
    places = [(place[:, 3].tolist(), pin.rpy.matrixToRpy(place[:, :3]).tolist()) for place in chain]
    return serial_urdf(places, [(-3.0, 3.0)] * (len(chain) - 1))


@cache
def arm(folder: Path, name: str) -> Robot:
    chain = np.insert(CHAINS["seven"], 5, CHAINS["seven"][2], 0) if name == "eight" else CHAINS[name]
    return load_text(folder / f"{name}.urdf", urdf_of(chain))


@pytest.mark.parametrize("joints", [5, 8])
def test_what_few_and_many_joints_lack_is_said(folder: Path, joints: int) -> None:
    robot = arm(folder, "five") if joints == 5 else arm(folder, "eight")
    with pytest.raises(StructureError, match=rf"^the C library solves arms of six or seven joints; arm has {joints}$"):
        jacokin.ik.export_c(IKSolver(robot), folder / "c")
    assert not (folder / "c").exists()
    with pytest.raises(StructureError, match=rf"^maps are of arms with six or seven joints; arm has {joints}$"):
        build(robot, folder=folder / "map")


@pytest.mark.parametrize("name", CHAINS)
def test_the_tool_never_leaves_the_bound_of_reach(folder: Path, name: str, rng: np.random.Generator) -> None:
    robot = arm(folder, name)
    solver = IKSolver(robot, tool=jacokin.pose([0.05, 0.03, 0.1]), position_tolerance=0.01)
    bound = ReachBound(solver.verifier)
    for q in robot.sample(rng, 500):
        target = jacokin.ik.targets.interpret(solver.verifier.tool_pose(q), solver.frame)
        assert bound.exceeded(target) is None


@pytest.mark.one_quick
@pytest.mark.parametrize("name", CHAINS)
def test_far_targets_are_unreachable_whatever_the_way(folder: Path, name: str) -> None:
    robot = arm(folder, name)
    far = jacokin.pose([2.0, 1.5, 0.9], rpy=[0.3, 0.2, 1.0])
    targets: list[jacokin.ik.targets.Target] = [far, far.translation]
    if robot.dof == 6:
        targets += [jacokin.FreeAxis(far, axis=[0, 0, 1]), jacokin.FreeAxis(far, axis=[1, 0, 0], range=(-0.5, 0.5))]
    for method in ("auto", "qp"):
        solver = IKSolver(robot, method=method)
        for target in targets[: 2 if method == "qp" else None]:
            for closest in (True, False):
                result = solver.solve(target, closest=closest)
                assert result.status is Status.UNREACHABLE
                assert result.message.startswith("the target is farther away than the arm is long")
        assert set(solver.solve_batch(targets[:2]).status) == {Status.UNREACHABLE}


@pytest.mark.parametrize("digits", [5, 4])
def test_a_pose_in_few_digits_is_missed_by_what_the_message_says(
    folder: Path, digits: int, rng: np.random.Generator
) -> None:
    robot = arm(folder, "five")
    solver, missed = IKSolver(robot), 0
    for q in robot.sample(rng, 4):
        T = robot.forward_kinematics(q)
        target = jacokin.pose(np.round(T.translation, digits), rpy=np.round(pin.rpy.matrixToRpy(T.rotation), digits))
        result = solver.solve(target)
        if result.success:
            continue
        missed += 1
        assert result.status is Status.NO_CONVERGENCE
        sentence = result.message.partition(": ")[2].partition(" accept")[0]
        named = dict(each.split("=") for each in sentence.split(", "))
        assert named.keys() <= {"position_tolerance", "orientation_tolerance"}
        wider = IKSolver(robot, **{name: float(value) for name, value in named.items()})  # type: ignore[arg-type]  # numbers
        assert wider.solve(target).success
        assert result.restarts < 500
    assert missed


def test_an_axis_that_is_missed_by_rounding_is_accepted_by_the_tolerance_that_is_named(folder: Path) -> None:
    """Right angles of five digits: such an arm cannot point exactly down."""
    path = folder / "five_digits.urdf"
    chain = np.zeros((6, 3, 4))
    for place, (xyz, roll) in zip(
        chain,
        [((0, 0, 0.27), 0.0), ((0, 0, 0), -1.5708), ((0.05, -0.28, 0), 0.0), ((0.08, 0.34, 0), 0.0),
         ((0.08, 0.1, 0), -1.5708), ((0, 0, 0), 0.0)],
        strict=True,
    ):  # fmt: skip
        place[:, :3], place[:, 3] = pin.rpy.rpyToMatrix(roll, 0.0, 0.0), xyz
    path.write_text(urdf_of(chain))
    robot = jacokin.load_robot(path)
    target = jacokin.FreeAxis(jacokin.pose([0.25, -0.1, 0.15], down=True), axis=[0, 0, 1])
    result = IKSolver(robot).solve(target)
    assert result.status is Status.UNREACHABLE
    assert "the closest one misses by 7.3e-6 rad: orientation_tolerance=1e-5 accepts it" in result.message
    accepting = IKSolver(robot, orientation_tolerance=1e-5)
    assert accepting.solve(target).success
    assert not accepting.solve_all(target).complete


@pytest.mark.parametrize("name", ["five", "four", "three"])
def test_poses_within_loose_tolerances_have_what_solve_finds(folder: Path, name: str, rng: np.random.Generator) -> None:
    """Turned by a tenth of a radian from poses that the arm has."""
    robot = arm(folder, name)
    solver, exact = IKSolver(robot, orientation_tolerance=0.2), IKSolver(robot)
    for q in robot.sample(rng, 6):
        T = robot.forward_kinematics(q)
        turned = rng.normal(size=3)
        target = pin.SE3(pin.exp3(0.1 * turned / np.linalg.norm(turned)) @ T.rotation, T.translation)
        found, result = solver.solve_all(target, q), solver.solve(target, q)
        assert result.success, result.message
        assert len(found)
        assert not found.complete
        assert "none of them exactly" in repr(found)
        np.testing.assert_array_equal(found.q[0], result.q)
        for point in found.q:
            error = target.actInv(robot.forward_kinematics(point))
            assert np.linalg.norm(error.translation) <= 1e-6
            assert np.linalg.norm(pin.log3(error.rotation)) <= 0.2
            assert robot.within_limits(point)
        assert found.orientation_error.min() <= 0.1 + 1e-6  # q itself is turned by so much
        assert not len(exact.solve_all(target, q))
        assert exact.solve_all(target, q).complete
        own = solver.solve_all(T, q)  # what is met exactly goes before
        assert own.complete
        np.testing.assert_allclose(own.q[0], q, atol=1e-7)
