"""`Episode`: one simulation of a task, from reset to reset, for the environments of dm_env and Gymnasium alike."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.mujoco_bridge.arena import set_contact
from jacokin.mujoco_bridge.base import RandomState
from jacokin.mujoco_bridge.simulation.rendering import Renderers, RenderFlags
from jacokin.tasks import registry
from jacokin.tasks.features import StateView
from jacokin.tasks.task import CAMERA, CAMERAS, CONTROL_TIMESTEP, PHYSICS_TIMESTEP, TIME_LIMIT, State

DEPTH, SEGMENTATION = "depth", "segmentation"  # kinds of pictures beside colours
PICTURE = 84  # rows and columns of what the camera observes [pixels]
STEPS = round(TIME_LIMIT / CONTROL_TIMESTEP)  # of an episode of ours


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """Where an episode is.

    Attributes:
        state: of the simulation.
        sensordata: readings, some of which belong to the last step and do not follow from the state.
        goal: of the episode.
        steps: control steps since the start; None before the first reset.
        action: of the last step.
    """

    state: Array
    sensordata: Array
    goal: Array
    steps: int | None
    action: Array


class Episode:
    """A task, its simulation, and the number of steps taken.

    Attributes:
        task: the task.
        physics: the simulation, that of the task.
        goal: of the episode.
        steps: control steps since the start, counted by the environment; None before the first reset, during a step,
            and after one that has failed or was interrupted.
        action: of the last step, in the units of the control; zeros at the start.
        substeps: physics steps of a control step.
        most_steps: control steps until the time limit.
    """

    def __init__(self, name: str, contact: str, control_timestep: float = CONTROL_TIMESTEP) -> None:
        """Compile the scene of a task.

        Args:
            name: of the task.
            contact: how friction is solved, as for an `Arena`.
            control_timestep: time between two actions [s], some physics steps.

        Raises:
            UnknownNameError: no such task or contact.
        """
        self.task = registry.make(name)
        self.physics = self.task.physics
        set_contact(self.physics.model.opt, contact)
        self.substeps = round(control_timestep / PHYSICS_TIMESTEP)
        self.most_steps = self.task.steps_of(control_timestep)
        self._view = StateView.of(self.physics.data)
        self.goal: Array = np.zeros(self.task.goal_size)
        self.action: Array = np.zeros(self.physics.model.nu)
        self.steps: int | None = None
        names = _camera_names(self.physics.model)
        self._cameras = {name: next(each for each in names if each.endswith(name)) for name in CAMERAS}
        self._renderers = Renderers(self.physics.model)
        limits = self.physics.model.actuator_ctrlrange
        self.lower, self.upper = (checks.read_only(bound) for bound in limits.T)

    @property
    def view(self) -> StateView:
        """Live arrays of the simulation; what `Physics.set_qpos` has left due is computed first."""
        _ = self.physics.data  # computes what is due
        return self._view

    @property
    def state(self) -> State:
        """What the reward is computed of."""
        return State(self.task, self.view, self.goal, self.action)

    @property
    def is_over(self) -> bool:
        """Whether the time limit is reached."""
        return self.steps is not None and self.steps >= self.most_steps

    def start(self, random_state: RandomState) -> None:
        """Draw an initial state.

        Raises:
            EpisodeInitializationError: none was found; a reset is due.
        """
        self.steps = None
        self.action = np.zeros_like(self.action)
        self.goal = self.task.start(random_state)
        self.steps = 0

    def advance(self, action: Array, substeps: int | None = None) -> None:
        """Simulate one control step, or some of its physics steps.

        Args:
            action: (nu,) within the limits.
            substeps: how many physics steps; None for all of a control step.

        Raises:
            PhysicsError: the simulation diverged; a reset is due.
        """
        self.physics.data.ctrl[:] = action
        self.physics.step(self.substeps if substeps is None else substeps)

    def picture(
        self,
        height: int = PICTURE,
        width: int = PICTURE,
        *,
        camera: str = CAMERA,
        kind: str = "",
        data: mujoco.MjData | None = None,
        flags: RenderFlags | None = None,
    ) -> NDArray[np.generic]:
        """What the camera sees.

        Colours are (height, width, 3) uint8, the depth (height, width, 1) float32 [m], numbers of geoms (height, width,
        1) int32, -1 where there is none.

        Args:
            height: rows [pixels].
            width: columns [pixels].
            camera: one of `CAMERAS`.
            kind: "" for colours, `DEPTH` or `SEGMENTATION`.
            data: of another simulation of the model; None for this one.
            flags: of rendering, see `Physics.render`.

        Raises:
            PhysicsError: there is no OpenGL context.
        """
        with self.physics.lock:
            found = self._renderers.render(
                self.physics.data if data is None else data,
                height,
                width,
                self._cameras[camera],
                depth=kind == DEPTH,
                segmentation=kind == SEGMENTATION,
                render_flag_overrides=flags,
            )
        if kind == DEPTH:
            return found[..., None]
        if kind == SEGMENTATION:  # numbers and types of objects
            is_geom = found[..., 1:] == int(mujoco.mjtObj.mjOBJ_GEOM)
            return np.where(is_geom, found[..., :1], -1).astype(np.int32)
        return found

    def snapshot(self) -> Snapshot:
        """Where the episode is now."""
        sensordata = self.physics.data.sensordata.copy()  # first: a pass that is due changes the state's warm start
        return Snapshot(self.physics.get_state(), sensordata, self.goal.copy(), self.steps, self.action.copy())

    def restore(self, snapshot: Snapshot) -> None:
        """Go back to where an episode of the same task was; it goes on from there bit by bit as it did."""
        self.physics.set_state(snapshot.state)
        if snapshot.steps is not None:
            self.physics.forward()
            self.physics.set_state(snapshot.state)  # the pass has changed MuJoCo's warm start
            self.physics.data.sensordata[:] = snapshot.sensordata
        self.goal = snapshot.goal.copy()
        self.steps = snapshot.steps
        self.action = snapshot.action.copy()
        self.task.show_goal(self.goal)

    def close(self) -> None:
        """Free what pictures need."""
        self._renderers.close()


def _camera_names(model: mujoco.MjModel) -> list[str]:
    return [str(model.camera(number).name) for number in range(model.ncam)]


def clip_action(action: ArrayLike, lower: Array, upper: Array) -> Array:
    """An action within its bounds, as a new array; values beyond them are put on them.

    Args:
        action: what a user gave.
        lower: lower bounds, of any shape.
        upper: upper bounds.

    Raises:
        InvalidInputError: wrong shape, not real numbers, or NaN.
    """
    values = action if type(action) is np.ndarray else checks.array("action", action, "an array of numbers")
    if values.shape != lower.shape or values.dtype.kind not in "fiu":
        raise InvalidInputError(
            f"action must be numbers of shape {lower.shape}, got shape {values.shape} and dtype {values.dtype}"
        )
    found = np.asarray(np.minimum(np.maximum(values, lower), upper), dtype=np.float64)
    total = float(found.sum())
    if total != total:  # NaN; infinite values are bounded
        raise InvalidInputError(f"action must not be NaN, got {checks.shown(values)}")
    return found
