"""`Teleop`: a hand leads the tool. Read this file first.

A tick takes what the hand device said last, moves the tool's target by it, and lets the tracker follow. The tracker
keeps limits and distances; what is done here is whether there is something to follow, and what:

- The clutch: closing it ties the tool, where it is, to the hand, wherever that is. So nothing ever jumps.
- The target moves by differences of the hand's poses, and walls slow it; the steps of a hand that is slower than the
  ticks are smoothed, and single frames that no hand can have made are left out. A twist is the tracker's to follow.
- Inside a workspace, a tick after which the tool could not stop there is not taken.
- Without input for a while, with input that is malformed or with time that runs backwards, the arm brakes within its
  limits. When good input returns, the tool is tied to it anew.
- Another branch is reached by a planned motion without contact, which the tracker follows joint by joint.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Mapping as MappingType
from dataclasses import dataclass, replace
from enum import Enum
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array, Sealed
from jacokin.errors import InvalidInputError, StructureError
from jacokin.ik.seeds import checked_start
from jacokin.ik.solver import IKSolver
from jacokin.model import checks, poses
from jacokin.motion.free_motion.plan_motion import plan_motion
from jacokin.motion.joint_motion import ACCELERATION
from jacokin.motion.rows import resting
from jacokin.motion.tracking.moving import Motion
from jacokin.motion.tracking.steps import TrackerStatus, TrackerStep
from jacokin.motion.tracking.targets import JointTarget
from jacokin.motion.tracking.tracker import STILL, Tracker
from jacokin.motion.tracking.twist import moved
from jacokin.motion.trajectory import MotionStatus, Trajectory
from jacokin.teleop.hand import (
    AHEAD,
    HandOptions,
    LowPass,
    Mapping,
    Play,
    SmoothedTarget,
    Witness,
    checked_workspace,
    dead,
    near,
    read_hand,
)

AUTO = "auto"
SAME = 1e-12  # relative: a hand that repeats its pose moves the target by rounding only
STAYS = 5e-3  # [rad] an arm that stays this near to where it was, and off its target by more than this, is stuck
FAR_OFF = 1e-3, 0.01  # [m], [rad]
LAG = 0.05  # [rad] a planned motion waits for joints that are farther behind
BLOCKED = 2.0  # [s] of waiting, after which a planned motion is given up
SPREAD = 5  # places on a branch that is a curve; those at its ends are not tried
ARRIVED = 1e-4  # [rad] nearer to the end of a planned motion, it is done


class TeleopStatus(Enum):
    """What a tick did; the value is a sentence that says what to try."""

    FOLLOWING = "the tool follows the hand; `tracking` says how well"
    HOLDING = "the clutch is open and the arm stays: clutch(True) ties the tool to the hand"
    WAITING = "the clutch is closed and the arm stays until the hand device says something"
    NO_INPUT = "the hand device has said nothing for too long, so the arm brakes; it goes on with the next input"
    BAD_INPUT = "what the hand device said cannot be used, see `message`, so the arm brakes; it goes on with good input"
    SWITCHING = "the arm moves to another branch, whatever the hand does; it follows again when it is there"


@poses.giving_copies("target")
@dataclass(frozen=True, slots=True, eq=False)
class TeleopStep(Sealed):
    """One tick. Arrays are read-only."""

    q: Array
    """(dof,) joint angles to command [rad], inside the limits exactly."""
    v: Array
    """(dof,) joint velocities that led here, constant over the tick [rad/s]."""
    status: TeleopStatus
    """What happened; `status.value` says what to try."""
    message: str
    """Why the arm does not follow, with numbers; empty when it does."""
    target: pin.SE3 | None
    """T_base_tool that the hand asks for, smoothed; by a twist, where it leads in a tick; None when the arm does not
    follow."""
    latency: float
    """By how much `target` lags behind a hand that moves steadily, because of `filter` [s]."""
    tracking: TrackerStep
    """What the tracker says."""

    def __str__(self) -> str:
        """The step on one line."""
        return f"{self.status.name}: {self.message or self.tracking}"


class Teleop:
    """Leads a tracker by a hand.

    Attributes:
        tracker: the tracker; nobody else may step it meanwhile.
        engaged: whether the clutch is closed.
    """

    def __init__(
        self,
        tracker: Tracker,
        *,
        scale: float = 1.0,
        clutch: bool = False,
        filter: float | str | None = AUTO,  # noqa: A002 - the field's word
        workspace: tuple[ArrayLike, ArrayLike] | None = None,
        recover: float | None = None,
        hand: HandOptions | None = None,
    ) -> None:
        """Lead a tracker.

        Args:
            tracker: what is led, from where it is.
            scale: the tool moves this many times as far as the hand.
            clutch: whether the clutch is closed from the start.
            filter: "auto" smooths the steps of a hand whose poses come more seldom than ticks: the target lags by two
                gaps between them, the longest of about the last second, and not at all where a pose comes in every
                tick. A number is the time constant of a low-pass [s], by which a target that moves steadily lags. 0 or
                None for neither.
            workspace: lower and upper corner (3,) [m] of a box in the base that neither the target nor the tool leaves,
                by more than 0.1 mm. The target slows down in the last 5 cm, and ends 1 mm before a wall; started
                outside, it may only go inwards.
            recover: a tool that is held off a target for this long [s] goes there by another branch, along a planned
                motion without contact, if there is one; None for never.
            hand: what the device is like; None for one whose axes are the base's.

        Raises:
            InvalidInputError: not a tracker, or a malformed number.
        """
        self.tracker = checks.instance("tracker", tracker, Tracker, "a Tracker")
        self._scale = checks.positive("scale", scale)
        self._hand = HandOptions() if hand is None else checks.instance("hand", hand, HandOptions, "HandOptions")
        self._axes, self._bands = self._hand.rotation, self._hand.bands
        self._constant = _checked_filter(filter)
        self._workspace = checked_workspace(workspace)
        self._frame = tracker.robot.frame_id(tracker.frame)
        self._patience = math.inf if recover is None else checks.positive("recover", recover, "s")
        self.engaged = checks.flag("clutch", clutch)
        self._time: float | None = None
        self._heard = 0.0
        self._rest: Array | None = None
        self._mapping: Mapping | None = None
        self._smooth: SmoothedTarget | LowPass | None = None
        self._play: Play | None = None
        self._twist: Array | None = None
        self._witness = Witness()
        self._speed = np.zeros(6)  # of twists, in base axes [m/s, rad/s]
        self._switch: _Switch | None = None
        self._now = 0.0
        self._lost = False
        self._place = tracker.q
        self._held = 0.0  # [s] for which the tracker has been held off its target

    @property
    def tool(self) -> pin.SE3:
        """T_base_tool, where the tool is."""
        return self.tracker.tool_pose

    def clutch(self, closed: bool) -> None:
        """Close the clutch, to follow from now on, or open it, to brake and stay.

        Closing it ties the tool, where it is, to the next input; closing a closed one does so anew. Either ends a
        motion to another branch.

        Raises:
            InvalidInputError: not True or False.
        """
        self.engaged = checks.flag("closed", closed)
        self._switch = None
        self._let_go()

    def step(
        self,
        hand: pin.SE3 | ArrayLike | None = None,
        time: float | None = None,
        *,
        obstacles: MappingType[str, Motion] | None = None,
        budget: float | None = None,
    ) -> TeleopStep:
        """One tick of the tracker.

        Args:
            hand: what the device said since the last tick, None for nothing: the hand's pose in the device's frame
                as `pin.SE3`, (4, 4) or (7,) position and quaternion wxyz, or its twist (6,) [m/s, rad/s] in the
                device's axes, which holds until the next one. What cannot be used makes the arm brake.
            time: of this tick [s], by any clock that does not run backwards; None for one tick after the last.
            obstacles: as in `Tracker.step`.
            budget: as in `Tracker.step`.

        Returns:
            Where the arm is after the tick.

        Raises:
            InvalidInputError: malformed obstacles or budget; nothing has changed then but what was heard.
        """
        around = _Around(obstacles, budget)
        fault = self._look_at_the_clock(time)
        heard: pin.SE3 | Array | None = None
        if hand is not None and not fault:
            try:
                heard = read_hand(hand)
                self._heard = self._now
            except InvalidInputError as error:
                fault = str(error)
        if self._switch is not None:
            self._hear(heard)
            return self._go_on_switching(self._switch, around)
        if not self.engaged:
            return self._stay(TeleopStatus.HOLDING, "", around)
        if fault:
            self._let_go()
            return self._stay(TeleopStatus.BAD_INPUT, fault, around)
        silent = self._now - self._heard
        if heard is None and self._mapping is not None and silent > self._hand.watchdog + 1e-9:
            self._let_go()
            self._lost = True
        if heard is None and self._mapping is None:
            if self._lost:
                return self._stay(TeleopStatus.NO_INPUT, f"no input for {silent:.2f} s", around)
            return self._stay(TeleopStatus.WAITING, "no input yet", around)
        self._lost = False
        return self._follow(heard, around)

    def switch_branch(self, q: ArrayLike | None = None, *, time_limit: float = 1.0) -> Trajectory:
        """Plan a motion without contact to another branch of the tool's pose, which the next ticks follow.

        The plan knows the tracker's scene with obstacles where the scene has them, and no moving ones; on the way the
        tracker keeps clear of these, too.

        Args:
            q: (dof,) the configuration to go to [rad]; None for the other branch that is reached soonest. On seven
                joints a branch is a curve: places spread over each of the others are tried.
            time_limit: for the search [s], in which the arm stands.

        Returns:
            The plan. Without a way its `success` is False, `message` says why, and the arm stays.

        Raises:
            InvalidInputError: the arm is not standing still (open the clutch and wait), `q` is malformed or outside the
                limits, `time_limit` is not positive, or without `q` no other branch is within the limits, or the arm's
                branches cannot be listed.
        """
        tracker, seconds = self.tracker, checks.positive("time_limit", time_limit, "s")
        if float(np.abs(tracker.v).max()) > STILL:
            raise InvalidInputError("the arm must stand still: open the clutch and step until it does")
        goals = self._other_branches() if q is None else [checked_start(tracker.robot, q)]
        plan = self._plan(goals, seconds)
        if plan.success:
            self._let_go()
            self._switch = _Switch(plan)
        return plan

    def _other_branches(self) -> list[Array]:
        """Configurations (dof,) of other branches of the tool's pose, within the limits; of curves, several of each.

        Raises:
            InvalidInputError: there are none, or they cannot be listed.
        """
        q, robot, solver = self.tracker.q, self.tracker.robot, self._solver()
        try:
            found = solver.solve_all(self.tool, seed=q)
        except StructureError as error:
            for joint, angle in zip(robot.joint_names, q.tolist(), strict=True):
                with contextlib.suppress(StructureError, InvalidInputError):  # of seven joints, any may be held
                    found = solver.solve_all(self.tool, seed=q, fixed={joint: angle})
                    break
            else:
                raise InvalidInputError(
                    f"the branches of {robot.label} cannot be listed, so give q, the configuration to go to: {error}"
                ) from error
        if found.dimension == 1:
            nearest = [interval.nearest(q) for interval in found.intervals]
            here = min(range(len(nearest)), key=lambda i: float(np.abs(nearest[i] - q).max()), default=0)
            rows = [
                row
                for interval, first in zip(found.intervals, nearest, strict=True)
                if interval.branch != found.intervals[here].branch
                for row in (first, *interval.sample(SPREAD)[1][1:-1])
            ]
        else:
            rows = list(found.q_within_limits)
        others = [row for row in rows if np.abs(row - q).max() > LAG]
        if not others:
            raise InvalidInputError("no other branch of the tool's pose is within the limits")
        return others

    def _solver(self) -> IKSolver:
        """Inverse kinematics of the tracker's tool among its obstacles."""
        tracker = self.tracker
        return IKSolver(
            tracker.robot,
            tracker.frame,
            tool=tracker.tool,
            scene=tracker.scene,
            # An arm that leans against its clearance must find a way, too.
            clearance=0.0 if tracker.scene is None else 0.8 * tracker.clearance,
        )

    def _plan(self, goals: list[Array] | list[pin.SE3], time_limit: float) -> Trajectory:
        """The soonest motion to one of some goals, for the tracker to follow: at nine tenths of its limits.

        With a workspace, the first that keeps the tool inside, by how far the joints go.
        """
        tracker, workspace, end = self.tracker, self._workspace, time.monotonic() + time_limit
        limit = np.inf if tracker.acceleration_limit is None else tracker.acceleration_limit
        acceleration = np.where(np.isfinite(limit), limit, ACCELERATION)
        solver = self._solver()

        def plan(those: list[Array] | list[pin.SE3], seconds: float) -> Trajectory:
            return plan_motion(
                solver,
                tracker.q,
                those,
                time_limit=seconds,
                dt=tracker.dt,
                velocity_limit=0.9 * tracker.velocity_limit,
                acceleration_limit=0.9 * acceleration,
            )

        found = plan(goals, time_limit)
        if workspace is None or not found.success:
            return found
        workspace.start_from(self.tool.translation)
        rows = [goal for goal in goals if not isinstance(goal, pin.SE3)]
        for goal in sorted(rows, key=lambda row: float((np.abs(row - tracker.q) / tracker.velocity_limit).max())):
            if self._stays_inside(found):
                return found
            left = end - time.monotonic()
            if left <= 0.0:
                break
            found = plan([goal], left)
        if found.success and self._stays_inside(found):
            return found
        return Trajectory.of(
            tracker.robot,
            tracker.velocity_limit,
            resting(tracker.q),
            status=MotionStatus.NO_WAY,
            message="no motion was found that keeps the tool inside the workspace",
        )

    def _stays_inside(self, plan: Trajectory) -> bool:
        """Whether a motion succeeds and keeps the tool inside the workspace."""
        tracker, workspace = self.tracker, self._workspace
        return plan.success and all(
            workspace is None
            or workspace.contains((tracker.robot.placement(row, self._frame) * tracker.tool).translation)
            for row in plan.q
        )

    def _look_at_the_clock(self, time: float | None) -> str:
        """Advance the time; why it cannot be used, empty if it can."""
        if time is None:
            self._now += self.tracker.dt
            return ""
        try:
            now = checks.number("time", time, "s")
        except InvalidInputError as error:
            return str(error)
        before, self._time = self._time, now
        if before is None:
            self._heard += now - self._now - self.tracker.dt
            self._now = now
            return ""
        if now < before:
            self._heard += now - self._now
            self._now = now
            return f"time ran backwards by {before - now:.3g} s"
        self._now = now
        return ""

    def _let_go(self) -> None:
        """Untie the tool from the hand; it is tied again by the next input."""
        self._mapping = self._smooth = self._play = self._twist = None
        self._witness = Witness()
        self._speed = np.zeros(6)
        self._rest = None
        self._lost = False

    def _follow(self, heard: pin.SE3 | Array | None, around: _Around) -> TeleopStep:
        """Move the target by what the hand did, and the arm towards it."""
        if self._mapping is None or self._smooth is None:
            tied = self.tool if self._workspace is None else self._workspace.tied(self.tool)
            self._mapping = Mapping(tied, self._axes, self._scale, self._hand.rotation_scale)
            self._smooth = (
                SmoothedTarget(self._mapping.target, self.tracker.dt, self._hand.watchdog)
                if self._constant is None
                else LowPass(self._mapping.target, self._constant, self.tracker.dt)
            )
        before = self._mapping.target
        self._hear(heard)
        if self._twist is not None:
            return self._follow_twist(self._twist, self._mapping, self._smooth, around)
        self._speed = np.zeros(6)
        is_new = not self._mapping.target.isApprox(before, SAME)
        target = self._smooth.move(self._mapping.target, is_new)
        tracking = self._track(target, around)
        self._rest = None
        self._held = self._held + self.tracker.dt if self._is_stuck(tracking) else 0.0
        if self._held > self._patience:
            self._recover(target)
        return TeleopStep(tracking.q, tracking.v, TeleopStatus.FOLLOWING, "", target, self._smooth.latency, tracking)

    def _follow_twist(
        self, twist: Array, mapping: Mapping, smooth: SmoothedTarget | LowPass, around: _Around
    ) -> TeleopStep:
        """Move the arm along a twist, which the tracker follows in its direction or not at all."""
        dt, before = self.tracker.dt, self.tool
        self._speed = self._speed + smooth.part * (mapping.in_base(twist) - self._speed)
        speed = self._speed.copy()
        if self._workspace is not None:
            speed[:3] = self._workspace.slowed(before.translation, dt * speed[:3]) / dt
        is_none = float(np.abs(speed).max()) < 1e-6  # [m/s], [rad/s]
        rests = is_none and float(np.abs(self.tracker.v).max()) <= STILL
        self._rest = None if not rests else self.tracker.q if self._rest is None else self._rest
        tracking = self._track(speed if self._rest is None else JointTarget(self._rest), around)
        # What the arm did not follow is not made up for, and a pose goes on from where it is.
        mapping.target = self.tool
        smooth.start_from(mapping.target)
        self._held = 0.0
        target = pin.SE3(moved(before.homogeneous, speed, dt))
        return TeleopStep(tracking.q, tracking.v, TeleopStatus.FOLLOWING, "", target, smooth.lag_of_twists, tracking)

    def _track(self, target: pin.SE3 | JointTarget | Array, around: _Around) -> TrackerStep:
        """A tick of the tracker after which the tool can stop inside the workspace; if there is none, of braking.

        Args:
            target: a pose, joint angles, or a twist (6,) at the tool in base axes.
            around: what `step` was given beside the hand.
        """
        tracker, workspace = self.tracker, self._workspace
        aims: list[pin.SE3 | JointTarget | Array] = [target]
        if workspace is not None:
            tool = self.tool
            workspace.start_from(tool.translation)
            if isinstance(target, pin.SE3):
                farther, nearer = (near(tool, target, *ahead) for ahead in AHEAD)
                aims = [farther, nearer, pin.SE3(tool.rotation, nearer.translation)]
            elif isinstance(target, np.ndarray):
                aims.append(np.append(target[:3], np.zeros(3)))
        before, limit = tracker._state, tracker.acceleration_limit
        aim: pin.SE3 | JointTarget | Array | None
        for aim in aims:
            pose, twist = (None, aim) if isinstance(aim, np.ndarray) else (aim, None)
            step = tracker.step(pose, twist=twist, obstacles=around.obstacles, budget=around.budget)
            if workspace is None or workspace.keeps(
                tracker.robot, self._frame, tracker.tool, step.q, step.v, limit, tracker.dt
            ):
                break
            tracker._state = before
        else:
            aim, step = None, tracker.brake(obstacles=around.obstacles)
        return step if workspace is None else self._in_workspace(target, step, aim is not aims[0])

    def _in_workspace(self, target: pin.SE3 | JointTarget | Array, step: TrackerStep, is_refused: bool) -> TrackerStep:
        """A tick that asked for a place on the way to a target, or for less, as one that asked for the target."""
        position, turn = step.position_error, step.orientation_error
        if isinstance(target, pin.SE3):
            tool = self.tool
            position = float(np.linalg.norm(tool.translation - target.translation))
            turn = float(np.linalg.norm(pin.log3(target.rotation @ tool.rotation.T)))
        if position <= step.position_error + SAME and turn <= step.orientation_error + SAME and not is_refused:
            return step
        status, limiting, message = step.status, step.limiting, step.message
        if is_refused:
            limiting, message = (*limiting, "workspace"), "the workspace holds the tool back"
        if status is not TrackerStatus.LATE:
            status = TrackerStatus.HELD if float(np.abs(step.v).max()) < STILL else TrackerStatus.LIMITED
        return replace(
            step,
            status=status,
            limiting=limiting,
            message=message or "on the way to a target that is far ahead",
            position_error=position,
            orientation_error=turn,
        )

    def _hear(self, heard: pin.SE3 | Array | None) -> None:
        """Move the target by how far the hand went since its last pose; keep a twist."""
        if self._mapping is None:
            return
        if isinstance(heard, pin.SE3):
            self._twist = None
            if self._constant != 0.0 and not self._witness.believes(heard, self._now):
                return
            if self._play is None:
                self._play = Play(*self._bands, heard)
            before = self._play.pose
            after = self._play.move(heard)
            turn = pin.log3(after.rotation @ before.rotation.T)
            self._mapping.shift(after.translation - before.translation, turn, self._workspace)
        elif heard is not None:
            self._twist, self._play = dead(heard, *self._bands), None

    def _is_stuck(self, tracking: TrackerStep) -> bool:
        """Whether the tracker has come as near as it can, or trembles and creeps about one place that is not there."""
        if tracking.status is TrackerStatus.HELD:
            return True
        is_off = tracking.position_error > FAR_OFF[0] or tracking.orientation_error > FAR_OFF[1]
        if is_off and float(np.abs(tracking.q - self._place).max()) < STAYS:
            return True
        self._place = tracking.q
        return False

    def _recover(self, target: pin.SE3) -> None:
        """Go to a target that is held off by another branch, if there is one."""
        self._held = -2.0  # [s] until another way is looked for again
        if self._solver().solve(target, seed=self.tracker.q).success:
            plan = self._plan([target], time_limit=0.3)
            if plan.success:
                self._switch = _Switch(plan)

    def _stay(self, status: TeleopStatus, message: str, around: _Around) -> TeleopStep:
        """Brake, and then keep the joints where they are."""
        if self._rest is None and float(np.abs(self.tracker.v).max()) > STILL:
            tracking = self.tracker.brake(obstacles=around.obstacles)
        else:
            if self._rest is None:
                self._rest = self.tracker.q
            tracking = self._track(JointTarget(self._rest), around)
        return TeleopStep(tracking.q, tracking.v, status, message, None, 0.0, tracking)

    def _go_on_switching(self, switch: _Switch, around: _Around) -> TeleopStep:
        """The next tick of a planned motion, which waits for an arm that is behind."""
        plan = switch.plan
        last = len(plan.q) - 1
        if float(np.abs(self.tracker.q - plan.q[switch.row]).max()) < LAG and switch.row < last:
            switch.row, switch.waited = switch.row + 1, 0.0
        else:
            switch.waited += self.tracker.dt
        tracking = self._track(JointTarget(plan.q[switch.row]), around)
        message = f"{plan.t[switch.row]:.1f} s of {plan.t[-1]:.1f} s"
        if switch.row == last and float(np.abs(tracking.q - plan.q[last]).max()) < ARRIVED:
            self._switch, self._heard = None, self._now
        elif switch.waited > BLOCKED:
            message = f"the way to the other branch is blocked after {message}: given up"
            self._switch = None
            self._let_go()
        return TeleopStep(tracking.q, tracking.v, TeleopStatus.SWITCHING, message, None, 0.0, tracking)


def _checked_filter(given: object) -> float | None:
    """A time constant [s], 0 for none; None for "auto".

    Raises:
        InvalidInputError: neither "auto" nor a number that is not negative.
    """
    if isinstance(given, str):
        if given != AUTO:
            raise checks.refusal("filter", '"auto", a time constant [s], or 0 or None for no filter', given)
        return None
    return 0.0 if given is None else checks.non_negative("filter", given, "s")


class _Around(NamedTuple):
    """What a tick of the tracker is given beside its target, as in `Tracker.step`."""

    obstacles: MappingType[str, Motion] | None
    budget: float | None


@dataclass(slots=True)
class _Switch:
    """A planned motion on its way.

    Attributes:
        plan: the motion.
        row: of the plan, which the arm is asked for.
        waited: for how long [s].
    """

    plan: Trajectory
    row: int = 0
    waited: float = 0.0
