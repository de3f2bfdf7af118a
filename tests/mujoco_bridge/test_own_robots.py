"""RobotArm and RobotHand subclassed for robots that are no Jaco."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
import pytest

from jacokin.errors import InvalidInputError, JacokinError
from jacokin.mujoco_bridge import Arena, JointsObservables, Physics, RobotArm, RobotHand
from jacokin.mujoco_bridge.base import RobotArm as RobotArmOfBase

REACHED = 1e-6  # [m] the promise


class Crane(RobotArm):
    """A hinge without limits, a slide with limits (unless told otherwise), and a hinge with limits."""

    def _build(self, slide_is_limited: bool = True) -> None:
        spec = self._mjcf_root = mujoco.MjSpec()
        spec.modelname = "crane"
        spec.compiler.degree = False
        tower = spec.worldbody.add_body(name="tower")
        self._joints = [tower.add_joint(name="turn", axis=(0.0, 0.0, 1.0))]
        trolley = tower.add_body(name="trolley", pos=(0.0, 0.0, 0.5))
        slide = trolley.add_joint(name="reach", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(1.0, 0.0, 0.0))
        slide.range = (0.1, 0.6)
        slide.limited = int(slide_is_limited)
        hook = trolley.add_body(name="hook", pos=(0.2, 0.0, -0.2))
        hinge = hook.add_joint(name="nod", axis=(0.0, 1.0, 0.0), range=(-1.0, 1.5), limited=1)
        self._joints += [slide, hinge]
        for body in (tower, trolley, hook):
            body.add_geom(size=(0.02, 0.0, 0.0), contype=0, conaffinity=0)
        self._wrist_site = hook.add_site(name="wrist", pos=(0.0, 0.0, -0.1))

    @property
    def joints(self) -> list[Any]:
        return self._joints

    @property
    def wrist_site(self) -> Any:
        return self._wrist_site


class Clamp(RobotHand):
    """One jaw on a slide."""

    def _build(self, name: str | None = None) -> None:
        spec = self._mjcf_root = mujoco.MjSpec()
        spec.modelname = name or "clamp"
        jaw = spec.worldbody.add_body(name="jaw")
        self._jaw = jaw.add_joint(name="jaw", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(1.0, 0.0, 0.0), range=(0.0, 0.05))
        jaw.add_geom(size=(0.01, 0.0, 0.0), contype=0, conaffinity=0)
        self._tip = spec.worldbody.add_site(name="tip", pos=(0.0, 0.0, -0.05))

    @property
    def joints(self) -> list[Any]:
        return [self._jaw]

    @property
    def tool_center_point(self) -> Any:
        return self._tip

    def set_grasp(self, physics: Physics, close_factors: float | Sequence[float]) -> None:
        bound = physics.bind(self.joints)
        bound.qpos = bound.range[:, 0] + (bound.range[:, 1] - bound.range[:, 0]) * close_factors
        physics.after_reset()


class CountingState(np.random.RandomState):
    """Counts what is drawn."""

    draws = 0

    def uniform(self, *args: Any, **kwargs: Any) -> Any:
        self.draws += 1
        return super().uniform(*args, **kwargs)


def scene() -> tuple[Physics, Crane, Clamp]:
    crane, clamp, arena = Crane(), Clamp(), Arena()
    crane.attach(clamp)
    arena.attach(crane, position=(0.2, 0.1, 0.0))
    return Physics.from_entity(arena), crane, clamp


def test_observables_come_along() -> None:
    physics, crane, clamp = scene()
    physics.bind(crane.joints).qpos = (4.0, 0.3, 0.5)
    physics.bind(clamp.joints).qvel = 0.02
    assert isinstance(crane.observables, JointsObservables)
    np.testing.assert_array_equal(crane.observables.joints_pos(physics), (4.0, 0.3, 0.5))
    np.testing.assert_array_equal(clamp.observables.joints_vel(physics), [0.02])
    assert sorted(clamp.observables.as_dict()) == ["crane/clamp/joints_pos", "crane/clamp/joints_vel"]
    assert Crane(name="left", observable_options={"joints_pos": {"enabled": True}}).observables.joints_pos.enabled
    assert Crane(name="left").name == "left"
    assert RobotArmOfBase is RobotArm


def test_randomization_comes_along() -> None:
    physics, crane, _ = scene()
    rng = CountingState(0)
    drawn = []
    for _ in range(500):
        crane.randomize_arm_joints(physics, rng)
        drawn.append(physics.bind(crane.joints).qpos.copy())
    q = np.array(drawn)
    assert rng.draws == 500
    assert (q >= (0.0, 0.1, -1.0)).all()
    assert (q <= (2.0 * np.pi, 0.6, 1.5)).all()
    assert (q.max(axis=0) - q.min(axis=0) > (6.2, 0.49, 2.4)).all()


def test_inverse_kinematics_comes_along() -> None:
    physics, crane, clamp = scene()
    rng = CountingState(1)
    for site in (crane.wrist_site, clamp.tool_center_point):
        for _ in range(20):
            twin = physics.copy()
            crane.randomize_arm_joints(twin, rng)
            wanted = twin.bind(site)
            quaternion = np.empty(4)
            mujoco.mju_mat2Quat(quaternion, wanted.xmat)
            assert crane.set_site_to_xpos(physics, rng, site, wanted.xpos, quaternion)
            np.testing.assert_allclose(physics.data.site(site.name).xpos, wanted.xpos, rtol=0.0, atol=REACHED)
            q = physics.bind(crane.joints).qpos
            assert 0.0 <= q[0] < 2.0 * np.pi
            assert 0.1 <= q[1] <= 0.6
            assert -1.0 <= q[2] <= 1.5


def test_random_states_are_drawn_from_for_restarts_alone() -> None:
    physics, crane, _ = scene()
    physics.bind(crane.joints).qpos = (1.0, 0.3, 0.2)
    physics.forward()
    site = physics.bind(crane.wrist_site)
    near, quaternion = site.xpos.copy(), np.empty(4)
    mujoco.mju_mat2Quat(quaternion, site.xmat.copy())
    physics.bind(crane.joints).qpos = (1.1, 0.32, 0.25)
    rng = CountingState(0)
    assert crane.set_site_to_xpos(physics, rng, crane.wrist_site, near, quaternion, max_ik_attempts=5)
    assert rng.draws == 0
    physics.step()
    before = physics.get_state().tobytes()
    for attempts in (1, 4):
        rng.draws = 0
        far = (3.0, 0.0, 0.5)
        assert not crane.set_site_to_xpos(physics, rng, crane.wrist_site, far, quaternion, max_ik_attempts=attempts)
        assert rng.draws == attempts - 1
        assert physics.get_state().tobytes() == before


def test_a_slide_without_limits_cannot_be_sampled() -> None:
    crane = Crane(slide_is_limited=False)
    physics = Physics.from_entity(crane)
    rng = np.random.RandomState(0)
    for ask in (
        lambda: crane.randomize_arm_joints(physics, rng),
        lambda: crane.set_site_to_xpos(physics, rng, crane.wrist_site, (0.3, 0.0, 0.2)),
    ):
        with pytest.raises(RuntimeError, match=r"only hinges can be sampled without limits.*'reach'") as error:
            ask()
        assert isinstance(error.value, JacokinError)


def test_what_is_abstract() -> None:
    with pytest.raises(TypeError, match="abstract"):
        RobotArm()  # type: ignore[abstract]
    with pytest.raises(TypeError, match="abstract"):
        RobotHand()  # type: ignore[abstract]


def test_an_arm_that_names_no_joints_is_told_so() -> None:
    class Jointless(Crane):
        @property
        def joints(self) -> list[mujoco.MjsJoint]:
            return []

    arm = Jointless()
    physics = Physics.from_entity(arm)
    with pytest.raises(InvalidInputError, match=r"^Jointless.joints is empty$"):
        arm.randomize_arm_joints(physics, np.random.default_rng(0))
