"""`Robot`: the joints, limits, frames, kinematics and dynamics of an arm. Read this file first.

A `Robot` is parsed, checked and immutable; `load_robot` makes one. Public joint vectors `q` hold one angle per joint
[rad], shape (dof,), in the order of `joint_names`, for continuous joints too. Poses are T_base_frame.
"""

from __future__ import annotations

import hashlib
import math
import threading
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, ModelError, UnknownNameError, shown
from jacokin.kernels.configurations.arm import Arm
from jacokin.kernels.configurations.dynamics import Bodies
from jacokin.model import angles, checks, dynamics, kinematics
from jacokin.model.checks import is_finite, is_plain, is_vector, vector_or_rows
from jacokin.model.descriptions import bundled, chain
from jacokin.model.descriptions.tools import frames_on, slides, usual_tools
from jacokin.model.descriptions.urdf import DisabledPairs
from jacokin.model.dynamics import ExternalWrench
from jacokin.model.measured_arm import MeasuredArm

if TYPE_CHECKING:
    import mujoco

Made = TypeVar("Made")


class Robot:
    """A serial arm in Pinocchio, with one coordinate per joint.

    Attributes:
        name: name of the robot.
        base: name of the frame poses are expressed in.
        default_frame: the frame meant when none is named.
        joint_names: names of the joints, base to tip.
        dof: number of joints.
        lower: (dof,) lower limits [rad]; -inf on unlimited joints. Read-only, as are the arrays below.
        upper: (dof,) upper limits [rad]; +inf on unlimited joints.
        sliding: (dof,) True where a joint is prismatic, with values in [m] instead of [rad].
        unlimited: (dof,) True where a joint has no limits.
        velocity_limit: (dof,) [rad/s]; inf where the file gives none, or 0.
        effort_limit: (dof,) [N m], what the loaded file says; inf where it gives none, or 0.
        acceleration_limit: (dof,) [rad/s^2], the table's for bundled arms; inf for others, whose files have none.
        finger_angle: angle at which the finger joints are locked [rad]; None for their reference position.
        frames: names usable as `frame`.
        pin_model: the Pinocchio model, nq == nv == dof. Treat it as read-only.
        source: where the description came from.
    """

    def __init__(
        self, model: pin.Model, known: Known, carried: Mapping[tuple[Hashable, ...], Any] | None = None
    ) -> None:
        """Wrap a chain made by `chain.extract`; users call `load_robot`.

        Args:
            model: the chain, nq == nv.
            known: what is known beside it.
            carried: what another robot of the same joints and shapes has `carried`.
        """
        self.pin_model = model
        self.name: str = model.name
        self.base, self.source, self.finger_angle = known.base, known.source, known.finger_angle
        self.dof: int = model.nv
        self.joint_names: tuple[str, ...] = tuple(model.names)[1:]
        self.lower = checks.read_only(model.lowerPositionLimit)
        self.upper = checks.read_only(model.upperPositionLimit)
        #: `lower` and `upper` as plain floats, for callers inside the package.
        self.limit_values: tuple[list[float], list[float]] = (self.lower.tolist(), self.upper.tolist())
        #: Those within which a solve may start.
        self.seed_limits: tuple[list[float], list[float]] = (
            np.maximum(self.lower, -angles.FARTHEST_SEED).tolist(),
            np.minimum(self.upper, angles.FARTHEST_SEED).tolist(),
        )
        self.unlimited: NDArray[np.bool_] = checks.sealed(np.isinf(self.lower) & np.isinf(self.upper))
        self.sliding = checks.sealed(np.array([slides(model, joint) for joint in range(1, model.njoints)], np.bool_))
        self.velocity_limit = checks.read_only(model.velocityLimit)
        self.effort_limit = checks.read_only(model.effortLimit)
        self.acceleration_limit = checks.read_only(_acceleration_limit(known.source.bundled, self.joint_names))
        self._frame_ids = chain.frame_names(model)
        self.frames: tuple[str, ...] = tuple(self._frame_ids)
        self.default_frame = chain.default_frame(model, known.tip)
        has_masses = dynamics.has_moving_masses(model) if known.has_masses is None else known.has_masses
        self._known = replace(known, tip=self.default_frame, has_masses=has_masses)
        self._local = _WorkingMemory(model)
        self._kept: dict[tuple[Hashable, ...], Any] = dict(carried or {})
        self._to_carry = set(self._kept)
        self._making = threading.RLock()
        self._sealed = True

    def __setattr__(self, name: str, value: object) -> None:
        """Refuse changes after construction: load another robot instead."""
        if "_sealed" in self.__dict__:
            raise AttributeError(f"a Robot does not change; load one with other arguments instead of setting {name!r}")
        super().__setattr__(name, value)

    def __repr__(self) -> str:
        """Name, joints and default frame on one line."""
        calibrated = "" if self.calibration is None else ", calibrated"
        return f"Robot({self.name!r}, dof={self.dof}, base={self.base!r}, frame={self.default_frame!r}{calibrated})"

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Pickle the model, its names and what it carries; working memory is made anew."""
        return Robot, (self.pin_model, self._known_now, self.carried)

    @property
    def _known_now(self) -> Known:
        """What is known beside the model, home as it was found."""
        return replace(self._known, home=self.__dict__.get("_found_home", self._known.home))

    def once(self, make: Callable[..., Made], *arguments: Hashable, carried: bool = False) -> Made:
        """What a function makes of this robot, made when it is first asked for and shared by all who ask.

        For callers inside the package. Threads that ask at the same time wait for the first. The last 16 results of a
        function are kept; what it raises is not.

        Args:
            make: a function of a module, called as `make(robot, *arguments)`.
            arguments: values that are hashed.
            carried: True for a result that is pickled with the robot.
        """
        key = (make, *arguments)
        try:
            found: Made = self._kept[key]
        except KeyError:
            with self._making:
                found = self._kept[key] if key in self._kept else make(self, *arguments)
                self._keep(key, found, carried=carried)
        return found

    def _keep(self, key: tuple[Hashable, ...], made: object, *, carried: bool) -> None:
        """Keep what was made, and let go of the oldest of the same function."""
        older = [each for each in self._kept if each[0] is key[0] and each != key]
        for each in older[: max(len(older) - 15, 0)]:  # 16 are enough for several tools, or angles of the fingers
            del self._kept[each]
            self._to_carry.discard(each)
        self._kept[key] = made
        if carried:
            self._to_carry.add(key)

    @property
    def carried(self) -> dict[tuple[Hashable, ...], Any]:
        """What was made `once` and goes wherever the robot goes."""
        with self._making:
            return {key: self._kept[key] for key in self._to_carry}

    @property
    def calibration(self) -> MeasuredArm | None:
        """How this arm differs from its description; None for the description's own numbers."""
        return self.source.calibration

    @property
    def label(self) -> str:
        """The name as people read it, which says when the arm is calibrated: "calibrated j2n6s300"."""
        return self.name if self.calibration is None else f"calibrated {self.name}"

    @cached_property
    def described(self) -> Robot:
        """This arm without its calibration, as the description has it (to rounding); itself without one."""
        measured = self.calibration
        if measured is None:
            return self
        known = replace(self._known, source=replace(self.source, calibration=None))
        return Robot(measured.undo(self.pin_model), known)

    def frame_id(self, frame: str | None = None) -> int:
        """Pinocchio's id of a frame; of the default frame when none is named.

        Raises:
            UnknownNameError: no such frame; lists the valid names.
        """
        try:
            return self._frame_ids[self.default_frame if frame is None else frame]
        except (KeyError, TypeError):
            raise UnknownNameError("frame", frame, self.frames) from None

    def joint_index(self, joint: str) -> int:
        """Position of a joint in `joint_names`.

        Raises:
            UnknownNameError: no such joint; lists the valid names.
        """
        return self.joint_names.index(checks.choice("joint", joint, self.joint_names))

    def configuration(self, q: ArrayLike, name: str = "q") -> Array:
        """`q` as a checked array (dof,) of angles [rad].

        Args:
            q: (dof,) joint angles [rad].
            name: what messages call it.

        Raises:
            InvalidInputError: wrong shape or not finite, or `name` is not a string.
        """
        if not isinstance(name, str):
            raise checks.refusal("name", "a string", name)
        return checks.vector(name, q, self.dof, "rad")

    def forward_kinematics(self, q: ArrayLike, frame: str | None = None) -> pin.SE3:
        """Pose of a frame in the base, at one configuration or at many.

        Args:
            q: (dof,) joint angles [rad]; or (n, dof), computed at once by a compiled kernel.
            frame: name of the frame; None for the default frame.

        Returns:
            T_base_frame, positions in [m]: a `pin.SE3`, or an array (n, 4, 4).

        Raises:
            InvalidInputError: `q` malformed.
            UnknownNameError: no such frame.
        """
        at = q if is_vector(q, self.dof) else vector_or_rows("q", q, self.dof, "rad")
        frame_id, model, data = self.frame_id(frame), self.pin_model, self._local.data
        if at.ndim == 2:
            return kinematics.poses(self._arm_of(frame_id), at)
        pin.forwardKinematics(model, data, at)
        return pin.updateFramePlacement(model, data, frame_id).copy()

    def _arm_of(self, frame_id: int) -> Arm:
        """The joints up to a frame, for the kernels."""
        return self.once(_arm_up_to, frame_id)

    def _weighed_arm(self) -> tuple[Arm, Bodies]:
        """All joints and what they move, for the kernels."""
        return self.once(_arm_with_bodies)

    def placement(self, q: Array, frame_id: int) -> pin.SE3:
        """Forward kinematics for callers inside the package: trusted arguments, and working memory for an answer.

        Args:
            q: (dof,) finite float64 joint angles [rad].
            frame_id: from `frame_id`.

        Returns:
            T_base_frame; overwritten by the next call on this thread.
        """
        data = self._local.data
        pin.forwardKinematics(self.pin_model, data, q)
        return pin.updateFramePlacement(self.pin_model, data, frame_id)

    def jacobian(self, q: ArrayLike, frame: str | None = None, reference: str = "local_world_aligned") -> Array:
        """Geometric Jacobian of a frame, at one configuration or at many: twist = J @ joint velocities.

        Args:
            q: (dof,) joint angles [rad]; or (n, dof), computed at once by a compiled kernel.
            frame: name of the frame; None for the default frame.
            reference: "local_world_aligned" (default, equals `mj_jacSite`), "local" or "world".

        Returns:
            (6, dof) or (n, 6, dof), linear rows [m/rad] first, then angular.

        Raises:
            InvalidInputError: `q` malformed.
            UnknownNameError: no such frame or reference.
        """
        at = q if is_vector(q, self.dof) else vector_or_rows("q", q, self.dof, "rad")
        frame_id, axes = self.frame_id(frame), kinematics.reference_frame(reference)
        if at.ndim == 2:
            return kinematics.jacobians(self._arm_of(frame_id), at, reference)
        jacobian: Array = pin.computeFrameJacobian(self.pin_model, self._local.data, at, frame_id, axes)
        return jacobian if jacobian.ndim == 2 else jacobian.reshape(6, 1)  # Pinocchio's form for a single joint

    def jacobian_time_derivative(
        self, q: ArrayLike, v: ArrayLike, frame: str | None = None, reference: str = "local_world_aligned"
    ) -> Array:
        """Time derivative of `jacobian` along joint velocities `v` [rad/s]; (6, dof). Errors as `jacobian`."""
        model, data = self.pin_model, self._local.data
        at, velocity = self.configuration(q), self.configuration(v, "v")
        frame_id, axes = self.frame_id(frame), kinematics.reference_frame(reference)
        pin.computeJointJacobiansTimeVariation(model, data, at, velocity)
        pin.updateFramePlacement(model, data, frame_id)
        derivative: Array = pin.getFrameJacobianTimeVariation(model, data, frame_id, axes)
        return derivative.reshape(6, self.dof)  # Pinocchio's form for a single joint is (6,)

    def jacobian_derivative(
        self, q: ArrayLike, frame: str | None = None, reference: str = "local_world_aligned"
    ) -> Array:
        """Kinematic Hessian, (6, dof, dof): [:, j, k] = d J[:, j] / d q_k. Errors as `jacobian`."""
        model, data, at = self.pin_model, self._local.data, self.configuration(q)
        frame_id, axes = self.frame_id(frame), kinematics.reference_frame(reference)
        pin.computeJointJacobians(model, data, at)
        pin.updateFramePlacement(model, data, frame_id)
        pin.computeJointKinematicHessians(model, data)
        tensor = pin.getFrameKinematicHessian(model, data, frame_id, axes)
        # Pinocchio's tensor is column major but arrives labelled row major.
        return np.ascontiguousarray(tensor.ravel(order="K").reshape(tensor.shape, order="F"))

    def analytical_jacobian(self, q: ArrayLike, frame: str | None = None, representation: str = "rpy") -> Array:
        """Jacobian whose lower rows are the rates of an orientation representation.

        Args:
            q: (dof,) joint angles [rad].
            frame: name of the frame; None for the default frame.
            representation: "rpy" (roll, pitch, yaw), "rotation_vector", or "quaternion" (w, x, y, z; w >= 0).

        Returns:
            (6, dof), or (7, dof) for the quaternion; position rows first.

        Raises:
            InvalidInputError: `q` malformed.
            UnknownNameError: no such frame or representation.
            RepresentationSingularity: the representation is singular here; names the angle.
        """
        q = self.configuration(q)
        rotation = self.forward_kinematics(q, frame).rotation
        return kinematics.analytical(rotation, self.jacobian(q, frame), representation)

    def singular_values(self, q: ArrayLike, frame: str | None = None) -> Array:
        """Singular values of the Jacobian, largest first (metres and radians mixed): (k,), or (n, k) for q (n, dof).

        Errors as `jacobian`.
        """
        return np.asarray(np.linalg.svd(self.jacobian(q, frame), compute_uv=False), dtype=np.float64)

    def manipulability(self, q: ArrayLike, frame: str | None = None) -> float:
        """Yoshikawa's measure sqrt(det(J J^T)), the product of the singular values. Errors as `configuration`.

        Source: Yoshikawa, Manipulability of Robotic Mechanisms, IJRR 4(2), 1985.
        """
        return float(np.prod(self.singular_values(self.configuration(q), frame)))

    def mass_matrix(self, q: ArrayLike) -> Array:
        """Mass matrix [kg m^2], with armature where the description has one.

        Args:
            q: (dof,) joint angles [rad]; or (n, dof), computed at once by a compiled kernel.

        Returns:
            (dof, dof) or (n, dof, dof).

        Raises:
            InvalidInputError: `q` malformed.
            ModelError: the description gives no masses.
        """
        self.check_masses()
        at = q if is_vector(q, self.dof) else vector_or_rows("q", q, self.dof, "rad")
        if at.ndim == 2:
            return dynamics.mass_matrices(*self._weighed_arm(), at)
        matrix: Array = pin.crba(self.pin_model, self._local.data, at)
        return matrix if matrix.ndim == 2 else matrix.reshape(1, 1)  # Pinocchio's form for a single joint

    def gravity(self, q: ArrayLike, *, base: pin.SE3 | ArrayLike | None = None) -> Array:
        """Joint torques that hold the arm still against gravity.

        Args:
            q: (dof,) joint angles [rad]; or (n, dof), computed at once by a compiled kernel.
            base: T_world_base, how the base is mounted in a world whose gravity points along -z; a `pin.SE3` or (4, 4).
                None for gravity as in the description.

        Returns:
            (dof,) or (n, dof) [N m].

        Raises:
            InvalidInputError: `q` or `base` malformed.
            ModelError: the description gives no masses.
        """
        self.check_masses()
        at = q if is_vector(q, self.dof) else vector_or_rows("q", q, self.dof, "rad")
        if at.ndim == 2:
            still = np.zeros(at.shape)
            return dynamics.torques(*self._weighed_arm(), at, still, still, dynamics.gravity(self.pin_model, base))
        torque: Array = pin.computeGeneralizedGravity(self.pin_model, self._local.data, at)
        return torque if base is None else torque - self._push(at, None, None, base)

    def coriolis(self, q: ArrayLike, v: ArrayLike) -> Array:
        """Matrix C (dof, dof) with C @ v the Coriolis and centrifugal torques [N m]; dM/dt = C + C^T.

        Args:
            q: (dof,) joint angles [rad].
            v: (dof,) joint velocities [rad/s].

        Raises:
            InvalidInputError: malformed, or too large for the answer to be finite.
            ModelError: the description gives no masses.
        """
        self.check_masses()
        model, data = self.pin_model, self._local.data
        at, velocity = self.configuration(q), self.configuration(v, "v")
        matrix = dynamics.answered(model, data, at, pin.computeCoriolisMatrix(model, data, at, velocity))
        return matrix if matrix.ndim == 2 else matrix.reshape(1, 1)  # Pinocchio's form for a single joint

    def inverse_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        *,
        external: ArrayLike | None = None,
        frame: str | None = None,
        base: pin.SE3 | ArrayLike | None = None,
    ) -> Array:
        """Motor torques of a motion: M(q) a + C(q, v) v + g(q) - J(q)^T external.

        Args:
            q: (dof,) joint angles [rad]; or (n, dof), and `v` and `a` too, computed at once by a compiled kernel.
            v: joint velocities [rad/s], in the shape of `q`.
            a: joint accelerations [rad/s^2], in the shape of `q`.
            external: (6,) wrench of the surroundings on the arm, at the frame's origin in base axes: force [N], then
                torque [N m]. None for none.
            frame: where `external` acts; None for the default frame.
            base: T_world_base, as in `gravity`.

        Returns:
            (dof,) or (n, dof) [N m].

        Raises:
            InvalidInputError: malformed, or too large for the answer to be finite.
            UnknownNameError: no such frame.
            ModelError: the description gives no masses.
        """
        self.check_masses()
        dof, model, data = self.dof, self.pin_model, self._local.data
        if external is None and base is None and is_plain(q, dof) and is_plain(v, dof) and is_plain(a, dof):
            self.frame_id(frame)
            torque: Array = pin.rnea(model, data, q, v, a)
            if is_finite(q.tolist() + v.tolist() + a.tolist() + torque.tolist()):
                return torque
        at, velocity, acceleration = (
            vector_or_rows("q", q, dof, "rad"),
            vector_or_rows("v", v, dof, "rad"),
            vector_or_rows("a", a, dof, "rad"),
        )
        if at.shape != velocity.shape or at.shape != acceleration.shape:
            raise InvalidInputError(
                f"q, v and a must have the same shape, got {at.shape}, {velocity.shape} and {acceleration.shape}"
            )
        if at.ndim == 2:
            gravity = dynamics.gravity(model, base)
            torque = dynamics.torques(*self._weighed_arm(), at, velocity, acceleration, gravity)
            pushed = self._pushes(at, external, frame)
            return dynamics.all_answered(model, at, torque if pushed is None else torque - pushed)
        torque = pin.rnea(model, data, at, velocity, acceleration) - self._push(at, external, frame, base)
        return dynamics.answered(model, data, at, torque)

    def forward_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        torque: ArrayLike,
        *,
        external: ArrayLike | None = None,
        frame: str | None = None,
        base: pin.SE3 | ArrayLike | None = None,
    ) -> Array:
        """Joint accelerations (dof,) [rad/s^2] under motor torques (dof,) [N m].

        The other arguments are those of `inverse_dynamics`, and so are the errors.

        Raises:
            ModelError: a joint moves no mass.
        """
        self.check_masses()
        dof, model, data = self.dof, self.pin_model, self._local.data
        if external is None and base is None and is_plain(q, dof) and is_plain(v, dof) and is_plain(torque, dof):
            self.frame_id(frame)
            acceleration: Array = pin.aba(model, data, q, v, torque)
            if is_finite(q.tolist() + v.tolist() + torque.tolist() + acceleration.tolist()):
                return acceleration
        at, velocity, applied = self.configuration(q), self.configuration(v, "v"), self.configuration(torque, "torque")
        applied = applied + self._push(at, external, frame, base)
        return dynamics.answered(model, data, at, np.array(pin.aba(model, data, at, velocity, applied)))

    def check_masses(self) -> None:
        """Refuse an arm whose joints move no mass: its torques would all be zero.

        Raises:
            ModelError: the description gives no masses.
        """
        if not self._known.has_masses:
            raise ModelError(
                f"the description of {self.name} ({self.source.path}) gives no masses that a joint moves, so no torque "
                "is known; robot.with_bodies takes masses"
            )

    def centre_of_mass(self, q: ArrayLike) -> Array:
        """Centre of mass (3,) of the whole robot in the base [m], its base link and locked fingers included.

        Raises:
            InvalidInputError: `q` malformed.
            ModelError: the description gives no masses.
        """
        return dynamics.centre_of_mass(self.pin_model, self._local.data, self.configuration(q))

    def operational_space_inertia(
        self, q: ArrayLike, frame: str | None = None, reference: str = "local_world_aligned"
    ) -> Array:
        """Inertia of the arm as felt at a frame: (J M^-1 J^T)^-1, (6, 6) [kg], [kg m] and [kg m^2].

        Args:
            q: (dof,) joint angles [rad].
            frame: name of the frame; None for the default frame.
            reference: axes, as in `jacobian`.

        Raises:
            InvalidInputError: `q` malformed, or the frame cannot move in all six directions there; names the direction.
            UnknownNameError: no such frame or reference.
            ModelError: a joint moves no mass.
        """
        q = self.configuration(q)
        return dynamics.operational_space_inertia(
            self.pin_model, self.jacobian(q, frame, reference), self.mass_matrix(q)
        )

    def external_wrench(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        torque: ArrayLike,
        *,
        frame: str | None = None,
        torque_covariance: ArrayLike | None = None,
        base: pin.SE3 | ArrayLike | None = None,
    ) -> ExternalWrench:
        """The wrench of the surroundings at a frame that explains measured motor torques.

        Args:
            q: (dof,) joint angles [rad].
            v: (dof,) joint velocities [rad/s].
            a: (dof,) joint accelerations [rad/s^2].
            torque: (dof,) torques of the motors on the joints [N m].
            frame: where the wrench acts; None for the default frame.
            torque_covariance: (dof, dof) of the errors of `torque` and of the model [N^2 m^2]; None for independent
                errors of 1 N m.
            base: T_world_base, as in `gravity`.

        Returns:
            The wrench in base axes with its covariance, and the directions that no joint feels.

        Raises:
            InvalidInputError: malformed, or a covariance that is not symmetric and positive definite.
            UnknownNameError: no such frame.
            ModelError: the description gives no masses.
        """
        applied = self.configuration(torque, "torque")
        q = self.configuration(q)
        missing = self.inverse_dynamics(q, v, a, base=base) - applied
        missing = dynamics.answered(self.pin_model, self._local.data, q, missing)
        return dynamics.wrench_of(self.jacobian(q, frame), missing, torque_covariance)

    def with_payload(
        self, mass: float, com: ArrayLike, inertia: ArrayLike | None = None, frame: str | None = None
    ) -> Robot:
        """This robot with a body fixed to a frame: another robot, with the same kinematics, limits and shapes.

        `crosscheck` against MuJoCo and `to_mujoco` take the description, which has no payload.

        Args:
            mass: [kg].
            com: (3,) centre of mass in the frame [m].
            inertia: (3, 3) about the centre of mass, in the frame's axes [kg m^2]; None for a point.
            frame: what carries it; None for the default frame.

        Raises:
            InvalidInputError: malformed, a negative mass, or an inertia that no body has.
            UnknownNameError: no such frame.
        """
        weight, centre = checks.non_negative("mass", mass, "kg"), checks.vector("com", com, 3, "m")
        loaded = dynamics.loaded(self.pin_model, self.frame_id(frame), weight, centre, inertia)
        return Robot(loaded, self._known_now, self.carried)

    def with_bodies(self, parameters: ArrayLike) -> Robot:
        """This robot with other masses, as `jacokin.model.identify_arm` finds them: another robot.

        Args:
            parameters: (dof, 10) of what each joint moves up to the next one, in Pinocchio's frame of the joint: mass
                [kg], mass times centre of mass (3) [kg m], inertia about the frame xx, xy, yy, xz, yz, zz [kg m^2].

        Raises:
            InvalidInputError: malformed, or of a body that cannot exist.
        """
        rows = checks.matrix("parameters", parameters, dynamics.BODY, "kg, kg m, kg m^2")
        if len(rows) != self.dof:
            raise InvalidInputError(f"parameters must have shape ({self.dof}, {dynamics.BODY}), got shape {rows.shape}")
        weighed = dynamics.reweighed(self.pin_model, rows)
        return Robot(weighed, replace(self._known_now, has_masses=True), self.carried)

    def _push(self, q: Array, external: ArrayLike | None, frame: str | None, base: pin.SE3 | ArrayLike | None) -> Array:
        """Joint torques (dof,) [N m] of what the description does not know: a wrench, and a base mounted otherwise."""
        frame_id, torque = self.frame_id(frame), np.zeros(self.dof)
        if external is not None:
            wrench = checks.vector("external", external, 6, "N, N m")
            data, axes = self._local.data, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            jacobian = pin.computeFrameJacobian(self.pin_model, data, q, frame_id, axes).reshape(6, self.dof)
            with np.errstate(over="ignore", invalid="ignore"):  # wrenches too large are refused with the answer
                torque += jacobian.T @ wrench
        if base is not None:
            torque -= dynamics.gravity_change(self.pin_model, self._local.data, q, base)
        return torque

    def _pushes(self, q: Array, external: ArrayLike | None, frame: str | None) -> Array | None:
        """Joint torques (n, dof) [N m] of one wrench at configurations (n, dof); None without one."""
        frame_id = self.frame_id(frame)
        if external is None:
            return None
        wrench = checks.vector("external", external, 6, "N, N m")
        along = kinematics.jacobians(self._arm_of(frame_id), q, "local_world_aligned").swapaxes(1, 2)
        with np.errstate(over="ignore", invalid="ignore"):  # wrenches too large are refused with the answer
            return np.asarray(along @ wrench)

    def within_limits(self, q: ArrayLike, tolerance: float = 0.0) -> bool:
        """Whether every joint lies inside its limits, give or take `tolerance` [rad].

        Raises:
            InvalidInputError: `q` malformed, or a tolerance that is not a finite number >= 0.
        """
        tolerance = checks.non_negative("tolerance", tolerance, "rad")
        angles = self.configuration(q)
        return bool((angles >= self.lower - tolerance).all() and (angles <= self.upper + tolerance).all())

    def sample(self, rng: np.random.Generator, size: int | None = None) -> Array:
        """Uniform configurations within the limits; unlimited joints in [-pi, pi).

        Args:
            rng: source of randomness.
            size: number of configurations; None for one.

        Returns:
            (dof,) or (size, dof) angles [rad].

        Raises:
            InvalidInputError: `rng` is not a Generator, `size` is negative, or a joint is limited on one side only.
        """
        checks.generator("rng", rng)
        size = checks.optional(checks.whole_number, "size", size)
        lower = np.where(self.unlimited, -np.pi, self.lower)
        upper = np.where(self.unlimited, np.pi, self.upper)
        if not np.isfinite(upper - lower).all():
            name = self.joint_names[int(np.argmin(np.isfinite(upper - lower)))]
            raise InvalidInputError(f"joint {name!r} is limited on one side only; sampling needs limits={{...}} for it")
        try:
            return rng.uniform(lower, upper, self.dof if size is None else (size, self.dof))
        except (MemoryError, ValueError, OverflowError) as error:
            raise InvalidInputError(f"size {shown(size)} is too large: so many samples do not fit in memory") from error

    def clearance(self, q: ArrayLike, scene: SceneLike, *, self_collision: bool = False) -> float | Array:
        """Smallest distance between the arm's collision shapes and those of a scene.

        Args:
            q: (dof,) or (n, dof) joint angles [rad].
            scene: a `jacokin.ik.Scene`.
            self_collision: True to measure the arm's own shapes against each other too.

        Returns:
            Distance [m], one for each row of `q`: negative where shapes overlap, infinite without any pair of shapes.

        Raises:
            InvalidInputError: `q` malformed, not a Scene, or an obstacle has the name of a shape of the arm.
            ModelError: the description has no collision shapes, or they cannot be loaded.
        """
        if not callable(getattr(scene, "measure", None)):
            raise checks.refusal("scene", "a Scene", scene)
        checks.flag("self_collision", self_collision)
        given = checks.array("q", q, f"{self.dof} numbers, or rows of them", "rad")
        if given.ndim == 1:
            return float(scene.measure(self, self.configuration(given)[np.newaxis], self_collision=self_collision)[0])
        return scene.measure(self, checks.matrix("q", given, self.dof, "rad"), self_collision=self_collision)

    def without_own_points(
        self, q: ArrayLike, points: ArrayLike, *, margin: float = 0.02, scene: SceneLike | None = None
    ) -> Array:
        """The points that are not on the arm: what a camera sees of it is no obstacle.

        All of its collision shapes count, those of its base and fingers among them.

        Args:
            q: (dof,) joint angles when the points were seen [rad].
            points: (n, 3) in the base [m].
            margin: points this near to a shape are left out, too [m]. More than the noise of the camera, than the
                radius and clearance that the points are to have as obstacles, and how far the arm may be from its
                description.
            scene: a `jacokin.ik.Scene` for the angle of the fingers and the shapes that the arm holds, which are left
                out as the arm is; None for the angle that the robot was loaded with.

        Returns:
            (k, 3) the others, in order [m].

        Raises:
            InvalidInputError: `q`, `points` or `margin` malformed, or not a Scene.
            ModelError: the description has no collision shapes, or they cannot be loaded.
        """
        if self._known.point_filter is None:
            raise ModelError(f"{self.name}: was not loaded with load_robot, so its own points are not known")
        return self._known.point_filter(self, q, points, margin, scene)

    @cached_property
    def home(self) -> Array:
        """A configuration within the limits, free of self-contact where there are collision shapes; (dof,) [rad]."""
        return checks.read_only(self._found_home.q)

    @property
    def home_source(self) -> str:
        """Where `home` comes from, in words; found with it."""
        return self._found_home.source

    @cached_property
    def tool_frames(self) -> tuple[str, ...]:
        """Frames on the last link that are called as tools are, the most usual first; all of them where none is."""
        return tuple(dict.fromkeys(usual_tools(frames_on(self.pin_model, self.dof))))

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """Sentences on what was left out of the description, guessed, or is missing there; `jacokin info` shows them.

        Found when they are first asked for, with the collision shapes. Empty for a bundled robot.
        """
        return () if self._known.notes is None else self._known.notes(self)

    def known_efforts(self) -> Array:
        """`effort_limit`, where the file gives it for every joint.

        Raises:
            InvalidInputError: it gives none for a joint.
        """
        return _stated(self, "effort", self.effort_limit, "torque_limit= [N m] in numbers")

    @cached_property
    def _found_home(self) -> Home:
        return self._known.home(self) if callable(self._known.home) else self._known.home


class _WorkingMemory(threading.local):
    """Working memory of Pinocchio, one for each thread, made when the thread first asks for it."""

    def __init__(self, model: pin.Model) -> None:
        """Make that of this thread."""
        self.data: pin.Data = model.createData()


@dataclass(frozen=True, slots=True)
class Source:
    """Where a robot came from, and what was read there: the file is not read again.

    Attributes:
        path: the description file.
        kind: "urdf" or "mjcf".
        bundled: name of the bundled robot, or None for a user's own file.
        base: base frame that was asked for, or None.
        tip: tip frame that was asked for, or None.
        package_dirs: folders that hold the packages of package:// meshes.
        limits: a user's own limits: joint, lower and upper [rad].
        content: the checked text of a URDF, or an MJCF as MuJoCo compiled it; None for bundled robots.
        calibration: how the arm differs from that content; None for not at all.
        notes: sentences on what was left out of the file.
        decompose: whether meshes collide as convex parts instead of one hull each.
        locked: joints off the arm that were locked at positions of the user's [rad], or [m]; and what follows them.
        followers: joints off the arm that mimic another one: joint, its leader, multiplier and offset [rad], or [m].
        velocity_limit: a user's own limits of velocity [rad/s]; empty for those of the file.
        home: a user's own home [rad]; empty for none.
        disabled: pairs of links whose contact with each other does not count, by an SRDF; None for no such file.
    """

    path: Path
    kind: str
    bundled: str | None
    base: str | None
    tip: str | None
    package_dirs: tuple[Path, ...] = ()
    limits: tuple[tuple[str, float, float], ...] = ()
    content: str | mujoco.MjModel | None = field(default=None, repr=False, compare=False)
    calibration: MeasuredArm | None = None
    notes: tuple[str, ...] = ()
    decompose: bool = False
    locked: tuple[tuple[str, float], ...] = ()
    followers: tuple[tuple[str, str, float, float], ...] = ()
    velocity_limit: tuple[float, ...] = ()
    home: tuple[float, ...] = ()
    disabled: DisabledPairs | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Home:
    """A configuration to start from, and where it comes from."""

    q: Array
    """(dof,) [rad]."""
    source: str
    """In words: a documented configuration, a keyframe, the middle of the limits, a search, or the user's own."""


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """What is known of a robot beside its model; functions are pickled by their names."""

    base: str
    """Name of the frame that is the model's universe."""
    tip: str | None
    """The default frame; None for an end effector or the last frame."""
    source: Source
    """Where it came from."""
    home: Home | HomeFinder
    """Or the function that finds it when it is first asked for."""
    finger_angle: float | None = None
    """At which joints off the chain were locked [rad]."""
    notes: NotesFinder | None = None
    """The function that finds `Robot.notes` when they are first asked for."""
    point_filter: PointFilter | None = None
    """The function behind `Robot.without_own_points`."""
    has_masses: bool | None = None
    """Whether the masses that joints move are known; None where the model tells."""


PointFilter = Callable[["Robot", ArrayLike, ArrayLike, float, "SceneLike | None"], Array]
HomeFinder = Callable[[Robot], Home]
NotesFinder = Callable[[Robot], tuple[str, ...]]


class SceneLike(Protocol):
    """What `Robot.clearance` measures against, as far as robots know it: a `Scene`."""

    def measure(self, robot: Robot, rows: Array, *, self_collision: bool = False) -> Array:
        """Distances (n,) [m] for configurations (n, dof) [rad]."""


def checked_robot(name: str, value: object) -> Robot:
    """A robot, or an error that names the argument.

    Raises:
        InvalidInputError: not a `Robot`.
    """
    return checks.instance(name, value, Robot, "a Robot, from load_robot")


class Joints(Protocol):
    """What has joints of which some may slide: a robot, a trajectory."""

    @property
    def sliding(self) -> NDArray[np.bool_]:
        """(dof,) which joints slide."""


def unit_of(joints: Joints, joint: int) -> str:
    """Of the values of a joint: "rad", or "m" where it slides."""
    return "m" if joints.sliding[joint] else "rad"


def in_words(joints: Joints, joint: int, value: float, digits: str = ".3g") -> str:
    """A value of a joint [rad, m] as people say it: "5 deg", or "5 mm" of one that slides."""
    return f"{1e3 * value:{digits}} mm" if joints.sliding[joint] else f"{math.degrees(value):{digits}} deg"


FASTEST = 1e4  # [rad/s] 1,600 turns a second; [m/s] where a joint slides
HARDEST = 1e6  # [rad/s^2] full speed of a fast arm within a few microseconds
TIME_TO_FULL_SPEED = 0.3  # [s] in tracking, by default, as joints of the Jaco take


def limit_margins(robot: Robot, q: Array) -> Array:
    """(..., dof) distance of checked configurations to the nearer limit [rad]: negative outside, inf without limits."""
    return np.asarray(np.minimum(q - robot.lower, robot.upper - q))


def copies_counted(robot: Robot) -> NDArray[np.int64]:
    """How many copies (dof,) of each joint's angle to look at, see `angles.copies_counted`; one of unlimited joints."""
    return robot.once(_counted)


def _counted(robot: Robot) -> NDArray[np.int64]:
    return checks.sealed(angles.copies_counted(robot.lower, robot.upper, ~robot.unlimited & ~robot.sliding))


def velocity_limits(robot: Robot, value: ArrayLike | None) -> Array:
    """The given limits (dof,) or one for all [rad/s], or the robot's own, 1e4 rad/s where those are larger.

    Raises:
        InvalidInputError: malformed, not positive or more than 1e4 rad/s, or the robot's file (MJCF has no such field)
            gives none.
    """
    return (
        robot.once(_own_velocities) if value is None else _bounded("velocity_limit", value, robot.dof, "rad/s", FASTEST)
    )


def _own_velocities(robot: Robot) -> Array:
    """The robot's own limits (dof,) [rad/s].

    Raises:
        InvalidInputError: its file gives none, or one that is not positive.
    """
    own = _stated(robot, "velocity", robot.velocity_limit, "velocity_limit= [rad/s]")
    return checks.positive_vector("velocity_limit", np.minimum(own, FASTEST), robot.dof, "rad/s")


def _stated(robot: Robot, what: str, limits: Array, cure: str) -> Array:
    """Limits (dof,) of a robot, which its file gives for every joint.

    Raises:
        InvalidInputError: it gives none for a joint.
    """
    missing = [name for name, limit in zip(robot.joint_names, limits, strict=True) if np.isinf(limit)]
    if missing:
        raise InvalidInputError(
            f"the description of {robot.name} ({robot.source.path}) gives no {what} limits for {', '.join(missing)}; "
            f"pass {cure}"
        )
    return limits


def acceleration_limits(robot: Robot, value: ArrayLike) -> Array:
    """The given limits (dof,) or one for all [rad/s^2].

    Raises:
        InvalidInputError: malformed, not positive or more than 1e6 rad/s^2.
    """
    return _bounded("acceleration_limit", value, robot.dof, "rad/s^2", HARDEST)


def jerk_limits(robot: Robot, value: ArrayLike | None) -> Array | None:
    """The given limits (dof,) or one for all [rad/s^3]; None for none.

    Raises:
        InvalidInputError: malformed, not positive or more than 1e9 rad/s^3.
    """
    return None if value is None else _bounded("jerk_limit", value, robot.dof, "rad/s^3", 1e9)


def _bounded(name: str, value: ArrayLike, size: int, unit: str, most: float, *, infinite: bool = False) -> Array:
    """Positive limits (size,) that no arm exceeds.

    Raises:
        InvalidInputError: malformed, not positive, or larger; with `infinite`, inf is taken.
    """
    found = checks.positive_vector(name, value, size, unit, infinite=infinite)
    largest = max((each for each in found.tolist() if each < np.inf), default=0.0)
    if largest > most:
        raise InvalidInputError(f"{name} must be at most {most:g} {unit}, got {largest:.6g} {unit}")
    return found


def _acceleration_limit(name: str | None, joint_names: Sequence[str]) -> Array:
    """(dof,) of a bundled arm by its table [rad/s^2], of the joint or of its actuator; inf for others."""
    joints = {} if name is None else bundled.arm_joints(name)
    rows = [{**bundled.actuator(row["group"]), **row} if (row := joints.get(joint)) else {} for joint in joint_names]
    return np.array([row.get("acceleration", np.inf) for row in rows])


def tracking_accelerations(robot: Robot, value: ArrayLike | None, velocity: Array) -> Array:
    """The given limits (dof,) or one for all [rad/s^2], inf for none, or the robot's own.

    A robot without ones of its own takes 0.3 s from rest to its velocity limits (dof,) [rad/s], as the Jaco does.

    Raises:
        InvalidInputError: malformed, not positive, or finite and more than 1e6 rad/s^2.
    """
    if value is None:
        own = robot.acceleration_limit
        return np.where(np.isfinite(own), own, velocity / TIME_TO_FULL_SPEED)
    return _bounded("acceleration_limit", value, robot.dof, "rad/s^2", HARDEST, infinite=True)


def catching_accelerations(robot: Robot, velocity: Array) -> Array:
    """(dof,) accelerations [rad/s^2] with which joints take 0.3 s to full speed: to catch up with targets by default.

    Joints that answer within a tick or two, as some can, jerk to and fro with a target that jumps. Full speed is that
    of the motion (dof,) [rad/s], or the robot's own where that is more.
    """
    return np.maximum(velocity, robot.velocity_limit) / TIME_TO_FULL_SPEED


# Of MuJoCo's arrays, what makes the shapes of an MJCF and says which of them meet.
GEOM = ("type", "size", "pos", "quat", "bodyid", "dataid", "contype", "conaffinity")


def fingerprint(robot: Robot, *, shapes: bool = False) -> str:
    """SHA-256 of joints, limits, placements and frames: two robots with the same one give the same answers.

    Args:
        robot: the arm.
        shapes: the collision shapes too.
    """
    model = robot.pin_model
    kinds = [joint.shortname() for joint in model.joints]
    names = [robot.base, robot.default_frame, *robot.joint_names, *robot.frames, *kinds]
    arrays = [robot.lower, robot.upper, robot.home]
    arrays += [placement.homogeneous for placement in model.jointPlacements]
    # The kind names an axis that is x, y or z, and no other.
    arrays += [kinematics.axis_of(model, index).direction for index, kind in enumerate(kinds) if "Unaligned" in kind]
    for name in robot.frames:
        frame = model.frames[robot.frame_id(name)]
        arrays += [np.array([frame.parentJoint]), frame.placement.homogeneous]
    content = hashlib.sha256("\n".join(names).encode())
    for array in arrays:
        content.update(np.ascontiguousarray(array, dtype=np.float64).tobytes())
    if shapes:
        content.update(_shapes(robot))
        content.update(b"decomposed" if robot.source.decompose else b"")
    return content.hexdigest()


def _shapes(robot: Robot) -> bytes:
    described = robot.source.content
    if described is None:
        return f"bundled {robot.source.bundled}".encode()
    if isinstance(described, str):
        disabled = robot.source.disabled
        return f"{described}{'' if disabled is None else disabled.pairs}".encode()
    arrays = [getattr(described, f"geom_{name}") for name in GEOM] + [described.mesh_vert, described.exclude_signature]
    return b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)


def middle(robot: Robot) -> Array:
    """Middle of the limits; zero on unlimited joints, zero clipped where one side is open [rad]."""
    both = np.isfinite(robot.lower) & np.isfinite(robot.upper)
    q = np.clip(np.zeros(robot.dof), robot.lower, robot.upper)
    q[both] = 0.5 * (robot.lower[both] + robot.upper[both])
    return np.clip(q, robot.lower, robot.upper)


def spread(robot: Robot, count: int) -> Array:
    """Random configurations (count, dof) [rad] of a fixed seed within the limits.

    At most half a turn from the middle: more leads to the same places.
    """
    centre = middle(robot)
    lower, upper = np.maximum(robot.lower, centre - np.pi), np.minimum(robot.upper, centre + np.pi)
    return np.random.default_rng(0).uniform(lower, upper, (count, robot.dof))


def _arm_up_to(robot: Robot, frame_id: int) -> Arm:
    return kinematics.arm_of(robot.pin_model, frame_id)


def _arm_with_bodies(robot: Robot) -> tuple[Arm, Bodies]:
    return kinematics.arm_of(robot.pin_model), dynamics.bodies_of(robot.pin_model)
