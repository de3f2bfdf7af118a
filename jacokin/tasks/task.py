"""`Task`: a scene, initial states, observations, and a reward of what is achieved and desired."""

from __future__ import annotations

import abc

import mujoco
import numpy as np

from jacokin.arrays import Array
from jacokin.mujoco_bridge import Arena, Physics, ToolCenterPointInitializer, cameras, observations, robots
from jacokin.mujoco_bridge.base import RandomState
from jacokin.mujoco_bridge.control.site_ik import Asking
from jacokin.mujoco_bridge.distributions import QuaternionFromAxisAngle, Uniform, uniform_box
from jacokin.mujoco_bridge.entity import Entity
from jacokin.mujoco_bridge.workspaces import BoundingBox
from jacokin.tasks import features
from jacokin.tasks.features import Feature, StateView, ids

CONTROL_TIMESTEP = 0.04  # [s]
SUBSTEPS = 20  # physics steps of 0.002 s
TIME_LIMIT = 10.0  # [s]
CAMERA = cameras.FRONT_CLOSE.name
BRICK = "duplo2x4"  # name of the first brick in dm_control's observations

ANY_YAW = QuaternionFromAxisAngle((0.0, 0.0, 1.0), Uniform(-np.pi, np.pi, single_sample=True))
"""A sampler of rotations about the vertical axis."""

_WAITING = (0.5, 0.0, 0.0)  # [m] where props are before the first reset
_APART = np.array((0.1, 0.0, 0.0))  # [m]

_SKY_RGB = ((0.4, 0.6, 0.8), (0.0, 0.0, 0.0))  # at the zenith, at the nadir
_FLOOR_RGB = ((0.2, 0.3, 0.4), (0.1, 0.2, 0.3))  # of the two kinds of tiles
_EDGE_RGB = (0.8, 0.8, 0.8)  # of the lines between tiles
_REFLECTANCE = 0.2  # of the floor
_HEADLIGHT, _LAMP, _SHINE = 0.6, 0.7, 0.3  # intensities
_FLOOR_SHINE = 0.5  # MuJoCo's default


class Task(abc.ABC):
    """One task with its compiled scene, in which initial states are made; environments simulate it.

    Read `families/reach` for an example.

    Attributes:
        arena: the root of the scene.
        arm: the arm.
        hand: the hand; its tool centre point is the pinch site.
        physics: the compiled scene.
        features: the observations in their order, without the camera.
        goal_size: how many numbers belong to an episode beside the state of its simulation.
        tool_box: where the tool centre point is at the start of an episode.
    """

    goal_size = 0
    tool_box: BoundingBox

    def __init__(self) -> None:
        """Compile the scene; for the first time on a machine, the closed form of the arm too (20 s)."""
        self.arena = Arena()
        _set_looks(self.arena.mjcf_model)
        cameras.add_camera_observables(self.arena, observations.VISION, cameras.FRONT_CLOSE)
        self.arm = robots.make_arm(observations.PERFECT_FEATURES)
        self.hand = robots.make_hand(observations.PERFECT_FEATURES)
        self.arm.attach(self.hand)
        self.arena.attach(self.arm, position=robots.ARM_OFFSET)
        self._waiting = 0
        self._add_props()
        self.physics = Physics.from_entity(self.arena)
        self.arm.prepare(self.physics)
        self.arm.set_home(self.physics)
        self._home: Array = self.physics.data.qpos.copy()
        self._tool = int(ids(self.physics, self.hand.tool_center_point)[0])
        self._tool_placer = ToolCenterPointInitializer(
            self.hand, self.arm, uniform_box(*self.tool_box), branch="nearest_to_random"
        )
        own = features.robot_features(self.physics, self.arm, self.hand)
        self.features: tuple[Feature, ...] = tuple(self._features(own))

    @abc.abstractmethod
    def _add_props(self) -> None:
        """Add what the task needs to the arena, before it is compiled."""

    @abc.abstractmethod
    def _features(self, own: list[Feature]) -> list[Feature]:
        """The observations in their order, with the robot's own among them."""

    @abc.abstractmethod
    def _initialize(self, random_state: RandomState) -> Asking[Array]:
        """Draw an initial state of the physics; returns the goal (goal_size,)."""

    @abc.abstractmethod
    def achieved(self, view: StateView, goal: Array) -> Array:
        """What counts for the reward, (..., a), of simulations with the goals (..., goal_size)."""

    @abc.abstractmethod
    def desired(self, view: StateView, goal: Array) -> Array:
        """What `achieved` should be, (..., a): the reward of this as achieved is the highest."""

    @abc.abstractmethod
    def reward(self, achieved: Array, desired: Array) -> Array:
        """The reward (...) in 0..1 of what is achieved and desired, both (..., a)."""

    @abc.abstractmethod
    def success(self, achieved: Array, desired: Array) -> Array:
        """Whether (...) the task is solved: all that its reward asks for is within its bounds."""

    def starting(self, random_state: RandomState) -> Asking[Array]:
        """Start an episode in `physics`: at rest, at time 0, controls 0.

        The caller answers the queries of inverse kinematics: one by one, as `site_ik.run` does, or for many episodes
        that start at once from one batched solve. Between a query and its answer, the state of `physics` may
        be another one.

        Args:
            random_state: drawn from in the same order each time.

        Returns:
            The goal (goal_size,) of the episode.

        Raises:
            EpisodeInitializationError: no initial state was found.
        """
        self._start_afresh()
        goal = yield from self._initialize(random_state)
        self.show_goal(goal)
        self.physics.after_reset()
        return goal

    def show_goal(self, goal: Array) -> None:  # noqa: B027 - most tasks have nothing to show
        """Show the goal of an episode in pictures, as far as the state of the simulation does not."""

    def _start_afresh(self) -> None:
        physics = self.physics
        with physics.lock:
            mujoco.mj_resetData(physics.model, physics.data)
            physics.data.qpos[:] = self._home  # not q = 0, where the arm touches itself, which is slow to simulate

    def _place_robot(self, random_state: RandomState) -> Asking[None]:
        self.hand.set_grasp(self.physics, float(random_state.uniform()))
        yield from self._place_tool(random_state)

    def _place_tool(self, random_state: RandomState) -> Asking[None]:
        return self._tool_placer.placing(self.physics, random_state)

    def tool(self, view: StateView) -> Array:
        """Position (..., 3) of the tool centre point [m]."""
        return view.site_xpos[..., self._tool, :]

    def _add_free(self, prop: Entity) -> None:
        """Add a prop that moves; it waits aside until it is placed."""
        self.arena.add_free_entity(prop, position=np.array(_WAITING) + self._waiting * _APART)
        self._waiting += 1

    def _add_fixed(self, prop: Entity) -> None:
        """Add something that stands still during an episode, and may be put elsewhere between two."""
        body = self.arena.attach(prop, position=np.array(_WAITING) + self._waiting * _APART)
        body.mocap = True
        self._waiting += 1


def _set_looks(spec: mujoco.MjSpec) -> None:
    """Give an arena the looks of the reference."""
    spec.visual.headlight.diffuse = [_HEADLIGHT] * 3
    for texture in spec.textures:
        if texture.type == mujoco.mjtTexture.mjTEXTURE_SKYBOX:
            texture.rgb1, texture.rgb2 = _SKY_RGB
        elif texture.builtin == mujoco.mjtBuiltin.mjBUILTIN_CHECKER:
            texture.rgb1, texture.rgb2 = _FLOOR_RGB
            texture.mark, texture.markrgb = mujoco.mjtMark.mjMARK_EDGE, _EDGE_RGB
            floor = spec.material(texture.name)
            floor.reflectance, floor.specular = _REFLECTANCE, _FLOOR_SHINE
    for light in spec.lights:
        light.diffuse, light.specular = [_LAMP] * 3, [_SHINE] * 3


def position_in_qpos(physics: Physics, prop: Entity) -> slice:
    """Where the position (3,) of a free prop is in qpos."""
    joint = prop.freejoint
    assert joint is not None, prop.name
    start = int(physics.model.jnt_qposadr[ids(physics, joint)[0]])
    return slice(start, start + 3)
