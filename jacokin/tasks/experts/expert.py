"""`expert`: a scripted policy for a task, and the scripts that reach and lift."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.tasks import registry
from jacokin.tasks.experts import grasps
from jacokin.tasks.experts.bricks import IN_CRADLE, ON_BRICK, place, reassemble, stack
from jacokin.tasks.experts.driver import BRICK, CLOSE, CLOSED, OPEN, RELEASE, SQUEEZE, ArmDriver, Script, shift, up
from jacokin.tasks.experts.grasps import point_down
from jacokin.tasks.gym.controls import FINGERS, FRAME
from jacokin.tasks.registry import FEATURES, TASKS
from jacokin.tasks.task import CONTROL_TIMESTEP

SIZE = 9  # joints and fingers
MISTAKE_SPEED = 0.5  # of the velocity limits, at most


@dataclass(frozen=True, slots=True)
class Disturbance:
    """What is done to the actions of a script.

    Attributes:
        noise: (9,) standard deviations of what is added to the velocities of joints and fingers [rad/s]; it forgets
            its direction within 0.2 s.
        mistakes: how many times in the first 4 s of an episode the arm moves somewhere for 0.4 s, at up to half its
            speed, with fingers that may open; the script then begins anew from there.
        seed: of the random numbers.
    """

    noise: tuple[float, ...]
    mistakes: int
    seed: int

    @classmethod
    def of(cls, noise: ArrayLike, mistakes: int, rng: np.random.Generator | None) -> Disturbance | None:
        """Of checked arguments of `expert`; None where nothing is disturbed.

        Raises:
            InvalidInputError: impossible ones.
        """
        values = checks.array("noise", noise, f"a number or {SIZE}")
        if values.size != 1 and values.shape != (SIZE,):
            raise InvalidInputError(f"noise must be one number or {SIZE}, got shape {values.shape}")
        if not np.isfinite(values).all() or (values < 0.0).any():
            raise checks.refusal("noise", "finite and not negative", noise, "rad/s")
        count = checks.whole_number("mistakes", mistakes)
        random_state = checks.generator("rng", np.random.default_rng(0) if rng is None else rng)
        if not values.any() and not count:
            return None
        each = tuple(np.broadcast_to(values.ravel(), SIZE).tolist())
        return cls(each, count, int(random_state.integers(2**32)))

    def disturbed(
        self, script: Callable[[ArmDriver], Script], arm: ArmDriver, random_state: np.random.Generator
    ) -> Script:
        """The actions of a script with noise and mistakes, within the limits of the actuators."""
        limit = np.append(arm.robot.velocity_limit, np.full(FINGERS, CLOSE))
        deviation = np.array(self.noise)
        # For 0.2 s noise keeps its direction: white noise would average out before the arm moves.
        kept = np.exp(-CONTROL_TIMESTEP / 0.2)
        last = round(4.0 / CONTROL_TIMESTEP)  # [s], which leaves time to mend them
        mistakes = set(random_state.integers(1, last, self.mistakes).tolist())
        noise, step, going = deviation * random_state.normal(size=len(deviation)), 0, _begun(script, arm)
        wrong, until = np.zeros(0), 0
        while True:
            if step in mistakes:
                wrong, until = self._mistake(limit, random_state), step + round(0.4 / CONTROL_TIMESTEP)
            elif until and step == until:
                going = _begun(script, arm)
            action = wrong if step < until else next(going, None)
            if action is None:
                return
            if action.shape != limit.shape:
                raise InvalidInputError(f"an expert of actions of shape {action.shape} cannot be disturbed")
            yield np.clip(action + noise, -limit, limit)
            noise = kept * noise + np.sqrt(1.0 - kept**2) * deviation * random_state.normal(size=len(deviation))
            step += 1

    @staticmethod
    def _mistake(limit: Array, random_state: np.random.Generator) -> Array:
        wrong = MISTAKE_SPEED * limit * random_state.uniform(-1.0, 1.0, len(limit))
        opens = random_state.uniform() < 0.5
        wrong[-FINGERS:] = -MISTAKE_SPEED * limit[-FINGERS:] if opens else 0.0
        return np.asarray(wrong)


def _begun(script: Callable[[ArmDriver], Script], arm: ArmDriver) -> Script:
    """The actions of a script.

    Raises:
        InvalidInputError: it gives something else, or an action is not made of numbers.
    """
    actions = script(arm)
    if not isinstance(actions, Iterator):
        raise checks.refusal("an expert", "a function of an ArmDriver that yields actions", actions)
    for action in actions:
        yield checks.array("what an expert's script yields", action, "an action, an array of numbers")


HEIGHT = 0.33  # [m] by which things are lifted
LYING = 0.05  # [m] below which the middle of a brick is that lies or stands on the table
LOST = 0.06  # [m] of a brick from the middle of the grip: it has fallen
HALF_BOX = 0.09  # [m]


def reach(arm: ArmDriver) -> Script:
    """Bring the pinch site to the target, in its present orientation where that is possible."""
    seen = arm.find("target_position")
    while True:
        # Above the middle of a brick it is near enough, and the fingers do not push it away.
        position = arm.get(seen[0], 3) if seen else arm.get(f"{BRICK}position", 3) + up(0.036)
        for rotation in (arm.pose.rotation, point_down(np.array((0.0, 1.0, 0.0)))):
            found = arm.configurations(pin.SE3(rotation, position))
            if len(found):
                break
        yield arm.towards(found[0] if len(found) else arm.q, 0.0)


def lift_brick(arm: ArmDriver) -> Script:
    """Grasp a brick and lift it; again if it falls, and on from where it is if the hand has it."""
    while True:
        brick = arm.prop(BRICK)
        height = float(brick.translation[2])
        if height > LYING and grasps.holds(arm, brick):
            top = shift(arm.pose, up(max(0.0, HEIGHT - height)))
        else:
            yield from _let_fall(arm)
            grasp = grasps.plan(arm, arm.prop(BRICK), [up(HEIGHT)]) or grasps.plan(arm, arm.prop(BRICK))
            if grasp is None:
                yield from arm.stay(0.0)
                return
            yield from grasps.take(arm, grasp)
            top = shift(grasp.pose, up(HEIGHT))
        for action in arm.move(top, SQUEEZE):
            yield action
            if not grasps.holds(arm, arm.prop(BRICK), LOST):
                break
        q = arm.q.copy()
        while grasps.holds(arm, arm.prop(BRICK)):
            yield arm.towards(q, CLOSE)


def _let_fall(arm: ArmDriver) -> Script:
    """Open the hand around a brick in the air, and wait until it lies still."""
    q = arm.q.copy()
    for _ in range(25):
        is_still = np.linalg.norm(arm.get(f"{BRICK}linear_velocity", 3)) < 0.02  # [m/s]
        if arm.prop(BRICK).translation[2] < LYING and is_still:
            return
        yield arm.towards(q, RELEASE)


def lift_large_box(arm: ArmDriver) -> Script:
    """Try to lift the large box by one of its edges.

    The open hand is 0.1765 m wide and the box 0.18 m, so all fingers do not go around it. What can be held is an
    upright edge, the thumb on one side and two fingers on the other. That needs friction of more than 1, and there is
    1: the script is a try, and the record of the experts has what comes of it.
    """
    box = arm.prop("unnamed_model/")
    best, cost = None, np.inf
    for corner in np.pi * np.array((0.25, 0.75, 1.25, 1.75)):
        outwards = box.rotation @ np.array((np.cos(corner), np.sin(corner), 0.0))
        across = np.array((-outwards[1], outwards[0], 0.0))
        edge = box.translation + (np.sqrt(2.0) * HALF_BOX - 0.03) * outwards
        for sign in (1.0, -1.0):
            tool = point_down(sign * across)
            at = pin.SE3(tool, edge + up(HALF_BOX - 0.02) - tool @ grasps.CENTRE)
            for q in arm.configurations(shift(at, up(0.1)))[:4]:
                if arm.chain([at], q, 2.0) is not None:
                    value = arm.duration(arm.q, q)
                    if value < cost:
                        best, cost = (q, at), value
    if best is not None:
        yield from arm.go(best[0], OPEN, tolerance=0.05)
        yield from arm.move(best[1], 0.4)
        yield from arm.close(30)  # until the fingers are as closed as the box lets them be
        yield from arm.move(shift(best[1], up(HEIGHT)), SQUEEZE, speed=0.1)
    yield from arm.stay(CLOSE)


SCRIPTS: dict[str, Callable[[ArmDriver], Script]] = {
    **{name: reach for name in TASKS if name.startswith("reach")},
    "lift_brick": lift_brick,
    "lift_large_box": lift_large_box,
    **{name: stack for name in TASKS if name.startswith("stack")},
    "reassemble_3_bricks_fixed_order": reassemble,
    "place_brick": partial(place, rest=ON_BRICK),
    "place_cradle": partial(place, rest=IN_CRADLE),
}


def _joint_delta(arm: ArmDriver, velocities: Array) -> Array:
    return velocities * CONTROL_TIMESTEP


def _joint_position(arm: ArmDriver, velocities: Array) -> Array:
    return np.concatenate((arm.q, arm.fingers)) + velocities * CONTROL_TIMESTEP


def _tool_velocity(arm: ArmDriver, velocities: Array) -> Array:
    twist = arm.robot.jacobian(arm.q, FRAME) @ velocities[: arm.robot.dof]
    return np.append(twist, velocities[arm.robot.dof :].mean())


def _tool_pose(arm: ArmDriver, velocities: Array) -> Array:
    angles = _joint_position(arm, velocities)
    pose = arm.pose_at(np.clip(angles[: arm.robot.dof], arm.robot.lower, arm.robot.upper))
    x, y, z, w = pin.Quaternion(pose.rotation).coeffs()
    closed = (angles[arm.robot.dof :].mean() - OPEN) / (CLOSED - OPEN)
    return np.concatenate((pose.translation, (w, x, y, z, np.clip(closed, 0.0, 1.0))))


CONTROLS: dict[str, Callable[[ArmDriver, Array], Array]] = {
    "joint_velocity": lambda arm, velocities: velocities,
    "joint_position": _joint_position,
    "joint_delta": _joint_delta,
    "tool_velocity": _tool_velocity,
    "tool_pose": _tool_pose,
}
"""The actions of each control that move joints and fingers with velocities (9,) [rad/s], for the next control step."""


class Expert:
    """A scripted policy; call it with an observation of features by name to get an action.

    It goes by what it has seen since `reset`, and by nothing but observations.

    Attributes:
        disturbance: noise and mistakes, None without.
        control: what its actions mean: one of `CONTROLS`.
    """

    def __init__(
        self,
        script: Callable[[ArmDriver], Script],
        disturbance: Disturbance | None = None,
        control: str = "joint_velocity",
    ) -> None:
        """Follow a script, disturbed by something."""
        self._script = script
        self.disturbance, self.control = disturbance, control
        self._arm = ArmDriver()
        self._actions: Script | None = None
        self._episode = 0

    @property
    def name(self) -> str:
        """What tells it from other experts of its task."""
        return "Expert" if self.disturbance is None else f"Expert, {self.disturbance}"

    def __reduce__(self) -> tuple[type[Expert], tuple[object, ...]]:
        """Pickle and copy the script; a copy begins anew."""
        return Expert, (self._script, self.disturbance, self.control)

    def reset(self, seed: int | None = None) -> None:
        """Begin anew, at the start of an episode.

        Args:
            seed: of the episode, which together with that of the expert determines the noise; None for another noise in
                each episode.

        Raises:
            InvalidInputError: not a whole number from 0.
        """
        self._episode = self._episode + 1 if seed is None else checks.whole_number("seed", seed)
        self._actions = None

    def __call__(self, observation: object) -> Array:
        """The action for an observation, in the units of the control.

        Args:
            observation: the features by name, with or without the leading axis of dm_control's buffers.

        Raises:
            InvalidInputError: something else, or a script of your own that ends before the episode, yields no array of
                numbers, or no velocities (9,), which other controls than that of joint velocities need.
        """
        self._arm.observe(observation)
        if self._actions is None:
            self._actions = self._begin()
        action = next(self._actions, None)
        if action is None:
            raise InvalidInputError(
                "the script of this expert has ended before the episode: let it end with `yield from arm.stay(0.0)`"
            )
        if self.control == "joint_velocity":
            return action
        if action.shape != (SIZE,):
            raise InvalidInputError(
                f"an expert of actions of shape {action.shape} is not one of velocities ({SIZE},), which control="
                f"{self.control!r} is computed of"
            )
        return CONTROLS[self.control](self._arm, action)

    def _begin(self) -> Script:
        if self.disturbance is None:
            return _begun(self._script, self._arm)
        random_state = np.random.default_rng((self.disturbance.seed, self._episode))
        return self.disturbance.disturbed(self._script, self._arm, random_state)


def expert(
    name: str,
    *,
    control: str = "joint_velocity",
    noise: ArrayLike = 0.0,
    mistakes: int = 0,
    rng: np.random.Generator | None = None,
) -> Expert:
    """A scripted policy for a task, which uses nothing but observations, the solver and the robot.

    With noise and mistakes it is a teacher that a learner sees mend what went wrong. Actions are those that are
    applied: record them as they are. Not every episode is solved then.

    Args:
        name: of the task or its environment, such as "lift_brick" or "lift_brick_features", or its id in Gymnasium, of
            ours or one that was registered with an expert.
        control: what actions mean, as in ``gymnasium.make(..., control=control)``. Scripts think in velocities of the
            joints; other controls follow them less exactly.
        noise: standard deviation of normal noise on the velocities of the joints and the fingers [rad/s], one number or
            nine; it is correlated over 0.2 s. Joints move at most 0.63 and 0.84 rad/s, fingers 5 rad/s.
        mistakes: how many times in the first 4 s of an episode the arm moves somewhere for 0.4 s, at up to half its
            speed, the fingers opening in every second of them; then the script begins anew.
        rng: random numbers of noise and mistakes; None for a fixed seed, so that results repeat.

    Raises:
        UnknownNameError: there is no expert for this task, or no such control; lists the valid ones.
        InvalidInputError: noise, mistakes or rng are impossible.
    """
    plain = registry.imported(name)
    task = plain.removesuffix(f"_{FEATURES}") if isinstance(plain, str) else plain
    scripts = {**SCRIPTS, **{own: entry.expert for own, entry in registry.TASKS.items() if entry.expert is not None}}
    script = scripts[checks.choice("expert", task, scripts)]
    return Expert(script, Disturbance.of(noise, mistakes, rng), checks.choice("control", control, CONTROLS))
