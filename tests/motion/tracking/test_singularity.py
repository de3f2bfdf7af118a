"""Through wrist, elbow and shoulder singularities: bounded speeds, no NaN, and back on the path soon after."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from jacokin import IKSolver, Robot, Tracker
from jacokin.motion import TrackerStatus, TrackerStep

DT = 0.01  # [s]
RECOVERY = 0.5  # [s]


def follow(tracker: Tracker, path: list[pin.SE3]) -> list[TrackerStep]:
    steps = []
    for pose in path:
        step = tracker.step(pose)
        assert np.isfinite(step.q).all()
        assert tracker.robot.within_limits(step.q)
        assert (np.abs(step.v) <= tracker.robot.velocity_limit + 1e-9).all()
        steps.append(step)
    return steps


def most_singular(robot: Robot, joint: int) -> float:
    """Angle of a joint, the others at home, at which the Jacobian is nearest to singular [rad]."""
    angles = np.linspace(max(robot.lower[joint], -3.1) + 0.4, min(robot.upper[joint], 3.2) - 0.4, 1500)
    q = np.tile(robot.home, (angles.size, 1))
    q[:, joint] = angles
    return float(angles[np.argmin([robot.singular_values(row)[-1] for row in q])])


@pytest.mark.one_quick("offset")
@pytest.mark.parametrize("joint", [2, 4], ids=["elbow", "wrist"])
@pytest.mark.parametrize("offset", [0.0, 1e-3, 2e-3])
def test_past_a_singular_pose(robot: Robot, joint: int, offset: float) -> None:
    """Poses of a joint motion through the singular configuration, then shifted so that the arm has to go round it."""
    middle = robot.home.copy()
    middle[joint] = most_singular(robot, joint)
    assert robot.singular_values(middle)[-1] < 1e-3
    q = np.tile(middle, (400, 1))
    q[:, joint] += np.linspace(-0.35, 0.35, 400)
    ramp = np.sin(np.linspace(0.0, np.pi, 400))  # the shift is there at the singularity and gone at both ends
    poses = [robot.forward_kinematics(row) for row in q]
    aside = offset * np.array([0.6, 0.0, 0.8])
    if not IKSolver(robot).solve(pin.SE3(poses[200].rotation, poses[200].translation + aside), seed=middle).success:
        aside = -aside  # the edge of reach is on the other side
    path = [pin.SE3(pose.rotation, pose.translation + part * aside) for pose, part in zip(poses, ramp, strict=True)]
    tracker = Tracker(robot, dt=DT, q=q[0])
    steps = follow(tracker, path + [path[-1]] * round(RECOVERY / DT))
    assert steps[-1].status is TrackerStatus.OK


@pytest.mark.parametrize(
    ("offset", "recovering"),
    [
        (2e-3, 6),
        pytest.param(0.0, 6, marks=pytest.mark.slow),
        pytest.param(0.02, 3, marks=pytest.mark.slow),
    ],
)
def test_over_the_shoulder(robot: Robot, offset: float, recovering: int) -> None:
    """The wrist crosses the axis of joint 1 in a straight line: the arm has to turn round at full speed.

    From some branches joints 2 and 3 meet their limits on the way; the arm stays there and says so.
    """
    rotation = robot.forward_kinematics(robot.home, "link_6").rotation
    ends = [np.array([side, offset, 0.75]) for side in (0.12, -0.12)]
    solver = IKSolver(robot, frame="link_6")
    starts = solver.solve_all(pin.SE3(rotation, ends[0])).q_within_limits
    assert len(starts) > 0
    way = np.concatenate([np.linspace(0.0, 1.0, 240), np.ones(300)])
    path = [pin.SE3(rotation, ends[0] + part * (ends[1] - ends[0])) for part in way]
    ends_with = [follow(Tracker(robot, "link_6", dt=DT, q=q), path)[-1].status for q in starts]
    assert set(ends_with) <= {TrackerStatus.OK, TrackerStatus.HELD}
    assert ends_with.count(TrackerStatus.OK) >= recovering  # of 10, 10 and 8 branches


def test_an_exactly_singular_start_does_not_stop_the_arm(robot: Robot) -> None:
    """Standing in a singular pose is no trouble, and a target elsewhere is approached."""
    q = robot.home.copy()
    q[2] = most_singular(robot, 2)
    tracker = Tracker(robot, dt=DT, q=q)
    start = robot.forward_kinematics(q)
    aside = pin.SE3(start.rotation, start.translation)
    steps = follow(tracker, [aside] * 5)
    assert steps[-1].status is TrackerStatus.OK
    back = robot.forward_kinematics(robot.home)
    steps = follow(tracker, [back] * 600)
    assert steps[-1].position_error < steps[0].position_error
