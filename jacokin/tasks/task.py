"""`Task`: a scene, initial states, observations, and a reward; `State`: what rewards are computed of."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import Any

import mujoco
import numpy as np

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, JacokinError, UnknownNameError
from jacokin.model import checks
from jacokin.mujoco_bridge import (
    Arena,
    JacoArm,
    JacoHand,
    Physics,
    PropPlacer,
    ToolCenterPointInitializer,
    cameras,
    observations,
    robots,
)
from jacokin.mujoco_bridge.base import RandomState
from jacokin.mujoco_bridge.distributions import QuaternionFromAxisAngle, Uniform, uniform_box
from jacokin.mujoco_bridge.entity import Entity, rotation_matrix
from jacokin.mujoco_bridge.props import FreeProp
from jacokin.mujoco_bridge.workspaces import BoundingBox
from jacokin.tasks import features
from jacokin.tasks.features import Feature, StateView, ids

CONTROL_TIMESTEP = 0.04  # [s]
PHYSICS_TIMESTEP = 0.002  # [s]
SUBSTEPS = round(CONTROL_TIMESTEP / PHYSICS_TIMESTEP)
TIME_LIMIT = 10.0  # [s]
CAMERA, WRIST = cameras.FRONT_CLOSE.name, "wrist"
WHOLE = cameras.WHOLE.name
CAMERAS = (CAMERA, WRIST, WHOLE)
BRICK = "duplo2x4"  # name of the first brick in dm_control's observations

ANY_YAW = QuaternionFromAxisAngle((0.0, 0.0, 1.0), Uniform(-np.pi, np.pi, single_sample=True))
"""A sampler of rotations about the vertical axis."""

_WAITING = (0.5, 0.0, 0.0)  # [m] where props are before the first reset
LYING = 0.001  # [m] height above the table at which things are placed
ATTEMPTS = 50  # to place a thing
_APART = np.array((0.1, 0.0, 0.0))  # [m]


class State:
    """What rewards are computed of: one simulation, or n, whose arrays have one more axis in front.

    ``state["mug/position"]`` is an observation by its name, exact and without noise, (..., 3) for a position. A
    function of it that leaves the leading axes alone serves one simulation and many.

    Attributes:
        view: the arrays of the simulation, for what no observation tells.
        goal: (..., goal_size) of the episode.
        action: (..., n) of the last control step, in the units of the control; 0 at the start of an episode.
    """

    __slots__ = ("_achieved", "_desired", "_task", "action", "goal", "view")

    def __init__(self, task: Task, view: StateView, goal: Array, action: Array) -> None:
        """Look at simulations of a task."""
        self._task: Task | None = task
        self.view, self.goal, self.action = view, goal, action
        self._achieved: Array | None = None
        self._desired: Array | None = None

    @classmethod
    def of_goals(cls, achieved: Array, desired: Array) -> State:
        """What hindsight knows: goals, and nothing else."""
        found = object.__new__(cls)
        found._task = None
        found._achieved, found._desired = np.broadcast_arrays(achieved, desired)
        return found

    def __getattr__(self, name: str) -> Array:
        """Refuse what hindsight does not know.

        Raises:
            InvalidInputError: only goals are known here.
        """
        if name in self.__slots__:
            raise self._unknown(name)
        raise AttributeError(name)

    def __getitem__(self, name: str) -> Array:
        """An observation by its name.

        Raises:
            UnknownNameError: no such observation; lists the valid ones.
            InvalidInputError: only goals are known here.
        """
        if self._task is None:
            raise self._unknown(name)
        by_name = self._task.features_by_name
        if name not in by_name:
            raise UnknownNameError("observation", name, by_name)
        return by_name[name].value(self.view, self.goal)

    @property
    def achieved(self) -> Array:
        """What is achieved, (..., a), see `Task.achieved`."""
        if self._achieved is None:
            assert self._task is not None  # otherwise it was given
            self._achieved = self._task.achieved(self.view, self.goal)
        return self._achieved

    @property
    def desired(self) -> Array:
        """What is desired, (..., a), see `Task.desired`."""
        if self._desired is None:
            assert self._task is not None
            self._desired = self._task.desired(self.view, self.goal)
        return self._desired

    @staticmethod
    def _unknown(name: str) -> InvalidInputError:
        return InvalidInputError(
            f"a reward of goals can use state.achieved and state.desired only, not {name!r}: hindsight computes it "
            "without a simulation"
        )


Corners = tuple[tuple[float, float, float], tuple[float, float, float]]  # lower and upper, as a BoundingBox has them
Measure = Callable[[State], Any]
"""A function of a state that gives a number, or an array, for each simulation."""


class Task:
    """One task with its compiled scene, in which initial states are made; environments simulate it.

    Composed of props and functions, or subclassed: `families.ReachSite` is an example. `register` makes it known by a
    name.

    Attributes:
        arena: the root of the scene.
        arm: the arm.
        hand: the hand; its tool centre point is the pinch site.
        props: what moves freely.
        fixtures: what stands still during an episode.
        physics: the compiled scene.
        features: the observations in their order, without the camera.
        goal_size: how many numbers belong to an episode beside the state of its simulation.
        tool_box: where the tool centre point is at the start of an episode.
        prop_box: where props and fixtures are placed: x and y of their origin, z of their lowest point [m].
        time_limit: how long an episode is [s].
    """

    goal_size = 0
    tool_box = BoundingBox((-0.1, -0.1, 0.2), (0.1, 0.1, 0.4))
    prop_box = BoundingBox((-0.1, -0.1, LYING), (0.1, 0.1, LYING))
    time_limit = TIME_LIMIT
    _recipe: tuple[tuple[Any, ...], dict[str, Any]]

    def __new__(cls, *args: Any, **kwargs: Any) -> Task:
        """Remember how the task is made: its scene cannot be copied."""
        task = object.__new__(cls)
        try:
            task._recipe = copy.deepcopy((args, kwargs))
        except TypeError as error:
            raise InvalidInputError(f"a task is made again for each copy, and one of its arguments: {error}") from error
        return task

    def __init__(
        self,
        arm: JacoArm | None = None,
        hand: JacoHand | None = None,
        props: Sequence[FreeProp] = (),
        *,
        fixtures: Sequence[Entity] = (),
        reward: Measure | None = None,
        success: Measure | None = None,
        achieved: Measure | None = None,
        desired: Measure | None = None,
        reset: Reset | None = None,
        observables: Sequence[Feature] = (),
        goal_size: int | None = None,
        tool_box: Corners | None = None,
        prop_box: Corners | None = None,
        time_limit: float | None = None,
    ) -> None:
        """Compile the scene.

        Args:
            arm: the arm, without its hand, which takes velocities, or torques, which then are the actions of
                control="joint_velocity"; None for that of the bundled robot.
            hand: the hand; None likewise.
            props: what moves freely, observed by its pose and velocity.
            fixtures: what stands still during an episode, observed by its position.
            reward: of a `State`, (...); None for 1 where the task is solved, else 0.
            success: whether a `State` is a solved one, (...) bool.
            achieved: of a `State`, (..., a): what hindsight compares with what is desired.
            desired: of a `State`, (..., a).
            reset: puts things in their places, called with the task and the random numbers; returns the goal
                (goal_size,), or None where there is none. None to put all that there is anywhere in `prop_box`, turned
                about the vertical axis, free of contact. The robot is placed afterwards.
            observables: observed beside the robot, the props and the fixtures.
            goal_size: how many numbers `reset` returns; None for none.
            tool_box: where the tool centre point is at first; None for a box above the middle of the table.
            prop_box: where things are at first; None for the middle of the table.
            time_limit: of an episode [s]; None for 10 s.

        Raises:
            InvalidInputError: an argument is wrong, two observations have the same name, or nothing tells whether the
                task is solved.
        """
        for name, given in (("reward", reward), ("success", success), ("achieved", achieved), ("desired", desired)):
            _check_callable(name, given)
        _check_callable("reset", reset)
        if success is None and type(self).success is Task.success:
            raise InvalidInputError("a task needs success=..., a function of a State, or a method of that name")
        if (achieved is None) != (desired is None):
            raise InvalidInputError("achieved and desired belong together: give both or none")
        self._reward, self._success, self._achieved, self._desired = reward, success, achieved, desired
        self._reset = reset
        if goal_size is not None:
            self.goal_size = checks.whole_number("goal_size", goal_size)
        if tool_box is not None:
            self.tool_box = _checked_box("tool_box", tool_box)
        if prop_box is not None:
            self.prop_box = _checked_box("prop_box", prop_box)
        if time_limit is not None:
            self.time_limit = checks.positive("time_limit", time_limit, "s")
        self.props, self.fixtures = _instances("props", props, FreeProp), _instances("fixtures", fixtures, Entity)
        self._observables = _instances("observables", observables, Feature)
        self.arena = Arena()
        _set_looks(self.arena.mjcf_model)
        cameras.add_camera_observables(self.arena, observations.VISION, cameras.FRONT_CLOSE, cameras.WHOLE)
        self.arm = (
            robots.make_arm(observations.PERFECT_FEATURES)
            if arm is None
            else checks.instance("arm", arm, JacoArm, "a JacoArm")
        )
        if self.arm.actuation == "position":
            raise InvalidInputError(
                "arm must take velocities or torques: of positions, joints without limits have no bounds; control="
                "'joint_position' of an environment moves an arm that takes velocities to joint angles"
            )
        if hand is None:
            hand = robots.make_hand(observations.PERFECT_FEATURES, self.arm.robot_name)
        self.hand = checks.instance("hand", hand, JacoHand, "a JacoHand")
        self.arm.attach(self.hand)
        self.arena.attach(self.arm, position=robots.ARM_OFFSET)
        _add_wrist_camera(self.hand)
        self._waiting = 0
        self.build()
        self.physics = Physics.from_entity(self.arena)
        self.arm.prepare(self.physics)
        self.arm.set_home(self.physics)
        self._home: Array = self.physics.data.qpos.copy()
        self._tool = int(ids(self.physics, self.hand.tool_center_point)[0])
        self._tool_placer = ToolCenterPointInitializer(
            self.hand, self.arm, uniform_box(*self.tool_box), branch="nearest_to_random"
        )
        self._default_placers = [self._placer(each) for each in (*self.fixtures, *self.props)]
        own = features.robot_features(self.physics, self.arm, self.hand)
        self.features: tuple[Feature, ...] = tuple(self.observe(own))
        self.features_by_name = features.by_name(self.features)

    def again(self) -> Task:
        """Another task made in the same way, with a scene of its own."""
        args, kwargs = copy.deepcopy(self._recipe)
        return type(self)(*args, **kwargs)

    def __reduce__(self) -> tuple[Any, ...]:
        """Copy and pickle how it was made."""
        return _make, (type(self), *self._recipe)

    @property
    def steps(self) -> int:
        """Control steps of 0.04 s in an episode."""
        return self.steps_of(CONTROL_TIMESTEP)

    def steps_of(self, control_timestep: float) -> int:
        """Control steps of some length [s] in an episode."""
        return max(1, round(self.time_limit / control_timestep))

    def build(self) -> None:
        """Add what the task needs to `arena`, before it is compiled: props and fixtures, and more in a subclass."""
        for prop in self.props:
            self.add_free(prop)
        for fixture in self.fixtures:
            self.add_fixed(fixture)

    def observe(self, own: list[Feature]) -> list[Feature]:
        """The observations in their order.

        Args:
            own: those of the robot.
        """
        found = [each for prop in self.props for each in features.prop_features(self.physics, prop)]
        found += [features.position_feature(self.physics, fixture) for fixture in self.fixtures]
        return [*own, *found, *self._observables]

    def initialize(self, random_state: RandomState) -> Array:
        """Draw an initial state of the physics: the opening of the hand, things, then the place of the tool.

        A subclass that draws in another order ends with ``self.place_tool(random_state)``.

        Returns:
            The goal (goal_size,) of the episode.

        Raises:
            InvalidInputError: `reset` did not return a goal of that size.
        """
        self.hand.set_grasp(self.physics, float(random_state.uniform()))
        goal = self.place_things(random_state)
        self.place_tool(random_state)
        return goal

    def place_things(self, random_state: RandomState) -> Array:
        """Put props and fixtures in their places by `reset`, or anywhere in `prop_box`; returns the goal."""
        if self._reset is None:
            for place in self._default_placers:
                place(self.physics, random_state)
            return np.zeros(self.goal_size)
        given = self._reset(self, random_state)
        goal = np.empty(0) if given is None else checks.array("the goal that reset returns", given, "numbers").ravel()
        if goal.shape != (self.goal_size,):
            raise InvalidInputError(
                f"reset must return a goal of {self.goal_size} numbers (goal_size), got {checks.shown(given)}"
            )
        return goal

    def place_robot(self, random_state: RandomState) -> None:
        """Open the hand somehow, and put the tool centre point somewhere in `tool_box`."""
        self.hand.set_grasp(self.physics, float(random_state.uniform()))
        self.place_tool(random_state)

    def place_tool(self, random_state: RandomState) -> None:
        """Put the tool centre point somewhere in `tool_box`."""
        self._tool_placer(self.physics, random_state)

    def achieved(self, view: StateView, goal: Array) -> Array:
        """What counts for the reward, (..., a), of simulations with the goals (..., goal_size)."""
        return self._measured("achieved", self._achieved, view, goal)

    def desired(self, view: StateView, goal: Array) -> Array:
        """What `achieved` should be, (..., a): the reward of this as achieved is the highest."""
        return self._measured("desired", self._desired, view, goal)

    def _measured(self, name: str, measure: Measure | None, view: StateView, goal: Array) -> Array:
        leading = view.qpos.shape[:-1]
        if measure is None:
            return np.zeros((*leading, 0))
        found = np.asarray(measure(State(self, view, goal, np.zeros(len(self.physics.data.ctrl)))), dtype=np.float64)
        if found.ndim != len(leading) + 1 or found.shape[:-1] != leading:
            raise InvalidInputError(f"{name} must give an array (..., a) for {leading}, got shape {found.shape}")
        return found

    def reward(self, achieved: Array, desired: Array) -> Array:
        """The reward (...) of what is achieved and desired, both (..., a)."""
        if self._reward is None:
            return self.success(achieved, desired).astype(np.float64)
        return measured("reward", self._reward, State.of_goals(achieved, desired))

    def success(self, achieved: Array, desired: Array) -> Array:
        """Whether (...) the task is solved: all that its reward asks for is within its bounds."""
        assert self._success is not None  # checked when the task was made
        return _succeeded(self._success, State.of_goals(achieved, desired))

    def score(self, state: State) -> Array:
        """The reward (...) of a state.

        Raises:
            InvalidInputError: the function that was given does not give one number for each simulation.
        """
        if self._reward is not None:
            return measured("reward", self._reward, state)
        if type(self).reward is Task.reward:
            return self.is_solved(state).astype(np.float64)
        return self.reward(state.achieved, state.desired)

    def is_solved(self, state: State) -> Array:
        """Whether (...) the task is solved in a state.

        Raises:
            InvalidInputError: as of `score`.
        """
        if self._success is not None:
            return _succeeded(self._success, state)
        return self.success(state.achieved, state.desired)

    def start(self, random_state: RandomState) -> Array:
        """Start an episode in `physics`: at rest, at time 0, controls 0.

        Args:
            random_state: drawn from in the same order each time.

        Returns:
            The goal (goal_size,) of the episode.

        Raises:
            EpisodeInitializationError: no initial state was found.
        """
        self._start_afresh()
        goal = self.initialize(random_state)
        self.show_goal(goal)
        self.physics.after_reset()
        return goal

    def show_goal(self, goal: Array) -> None:
        """Show the goal of an episode in pictures, as far as the state of the simulation does not."""

    def _start_afresh(self) -> None:
        physics = self.physics
        with physics.lock:
            mujoco.mj_resetData(physics.model, physics.data)
            physics.data.qpos[:] = self._home  # not q = 0, where the arm touches itself, which is slow to simulate

    def tool(self, view: StateView) -> Array:
        """Position (..., 3) of the tool centre point [m]."""
        return view.site_xpos[..., self._tool, :]

    def add_free(self, prop: Entity) -> None:
        """Add something that moves; it waits aside until it is placed."""
        self.arena.add_free_entity(prop, position=np.array(_WAITING) + self._waiting * _APART)
        self._waiting += 1

    def add_fixed(self, prop: Entity) -> None:
        """Add something that stands still during an episode, and may be put elsewhere between two."""
        body = self.arena.attach(prop, position=np.array(_WAITING) + self._waiting * _APART)
        body.mocap = True
        self._waiting += 1

    def _placer(self, thing: Entity) -> PropPlacer:
        """What puts a prop or a fixture on the table."""
        lift = np.array((0.0, 0.0, thing.height_above_lowest if isinstance(thing, FreeProp) else 0.0))
        lower, upper = (np.array(corner) + lift for corner in self.prop_box)
        return PropPlacer(
            [thing],
            uniform_box(lower, upper),
            ANY_YAW,
            settle_physics=isinstance(thing, FreeProp),
            max_attempts_per_prop=ATTEMPTS,
        )


Reset = Callable[[Task, RandomState], "Array | None"]


def _make(kind: type[Task], args: tuple[Any, ...], kwargs: dict[str, Any]) -> Task:
    return kind(*args, **kwargs)


def measured(name: str, measure: Measure, state: State) -> Array:
    """What a function gives of a state, one number for each simulation.

    Raises:
        InvalidInputError: it gives something else.
    """
    try:
        found = np.asarray(measure(state), dtype=np.float64)
    except (IndexError, TypeError, ValueError) as error:
        if isinstance(error, JacokinError):
            raise
        raise InvalidInputError(f"{name} of a State failed: {error}. {_AXES}") from error
    leading = state.desired.shape[:-1]
    if found.shape != leading:
        raise InvalidInputError(f"{name} must give numbers of shape {leading}, got shape {found.shape}. {_AXES}")
    return found


def _succeeded(measure: Measure, state: State) -> Array:
    """Whether a function says so of a state, of each simulation.

    Raises:
        InvalidInputError: it gives something else than True and False.
    """
    found = measured("success", measure, state)
    told = (found == 0.0) | (found == 1.0)
    if not told.all():
        raise InvalidInputError(f"success must give True or False, got {np.ravel(found)[~np.ravel(told)][0]:g}")
    return found.astype(np.bool_)


def check_rewards(task: str, rewards: Array | float, when: str = "") -> None:
    """Check that rewards can be learned from.

    Raises:
        InvalidInputError: one is NaN or infinite; names the task, and `when` it was.
    """
    if np.isfinite(rewards).all():
        return
    values = np.ravel(rewards)
    bad = values[~np.isfinite(values)][0]
    raise InvalidInputError(f"the reward of {task}{when} must be a finite number, got {bad:g}")


_AXES = 'It gets one state or many: index the last axes, as state["mug/position"][..., 2], and use np.where for if'


def _check_callable(name: str, given: object) -> None:
    if given is not None and not callable(given):
        raise checks.refusal(name, "a function of a State" if name != "reset" else "a function", given)


def _instances(name: str, given: Any, kind: type[Any]) -> tuple[Any, ...]:
    if not isinstance(given, list | tuple) or not all(isinstance(each, kind) for each in given):
        raise checks.refusal(name, f"a list of {kind.__name__}", given)
    return tuple(given)


def _checked_box(name: str, box: Any) -> BoundingBox:
    values = checks.array(name, box, "two corners")
    if values.shape != (2, 3) or not (values[0] <= values[1]).all():
        raise checks.refusal(name, "(lower, upper), two corners of 3 lengths [m]", box)
    return BoundingBox(tuple(values[0].tolist()), tuple(values[1].tolist()))


def _add_wrist_camera(hand: JacoHand) -> None:
    """Add a camera beside the hand, which looks past the fingers to where they pinch."""
    site = hand.tool_center_point
    axes = rotation_matrix(np.array(site.quat) / np.linalg.norm(site.quat))
    # In axes of the pinch site, whose z points out of the hand [m].
    position, aim = (np.array(site.pos) + axes @ np.array(at) for at in ((0.0, -0.14, -0.08), (0.0, 0.0, 0.06)))
    backwards = (position - aim) / np.linalg.norm(position - aim)
    right = np.cross(axes @ np.array((0.0, 1.0, 0.0)), backwards)
    right /= np.linalg.norm(right)
    camera = site.parent.add_camera(name=WRIST, pos=position, fovy=70.0)  # [deg]
    camera.alt.type = mujoco.mjtOrientation.mjORIENTATION_XYAXES
    camera.alt.xyaxes = np.concatenate((right, np.cross(backwards, right)))


def _set_looks(spec: mujoco.MjSpec) -> None:
    """Give an arena the looks of the reference."""
    spec.visual.headlight.diffuse = [0.6] * 3
    for texture in spec.textures:
        if texture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
            texture.rgb1, texture.rgb2 = (0.4, 0.6, 0.8), (0.0, 0.0, 0.0)  # at the zenith, at the nadir
        elif texture.builtin == mujoco.mjtBuiltin.mjBUILTIN_CHECKER:
            texture.rgb1, texture.rgb2 = (0.2, 0.3, 0.4), (0.1, 0.2, 0.3)  # of the two kinds of tiles
            texture.mark, texture.markrgb = mujoco.mjtMark.mjMARK_EDGE, (0.8, 0.8, 0.8)  # lines between tiles
            floor = spec.material(texture.name)
            floor.reflectance, floor.specular = 0.2, 0.5  # the latter is MuJoCo's default
    for light in spec.lights:
        light.diffuse, light.specular = [0.7] * 3, [0.3] * 3


def position_in_qpos(physics: Physics, prop: Entity) -> slice:
    """Where the position (3,) of a free prop is in qpos."""
    joint = prop.freejoint
    assert joint is not None, prop.name
    start = int(physics.model.jnt_qposadr[ids(physics, joint)[0]])
    return slice(start, start + 3)
