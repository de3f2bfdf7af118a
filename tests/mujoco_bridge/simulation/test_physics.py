"""Physics: when data are fresh, what a step does, and what is refused."""

from __future__ import annotations

import contextlib
import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from jacokin.errors import InvalidInputError, ModelError, PhysicsError, UnknownNameError
from jacokin.mujoco_bridge import Arena, JacoArm, JacoHand, ModelWrapperEntity, Physics, observations
from jacokin.mujoco_bridge.props import Primitive
from tests.mujoco_bridge.scenes import HOME, jaco_parts

INTEGRATION = int(mujoco.mjtState.mjSTATE_INTEGRATION)
FRESH = 1e-12  # [m] two runs of the same kinematics differ by rounding at most


def pendulum(integrator: str = "Euler", mocap: bool = False) -> Physics:
    floating = '<body name="mocap" mocap="true"><geom size="0.01" contype="0" conaffinity="0"/></body>'
    weld = '<equality><weld body1="mocap" body2="bob"/></equality>'
    return Physics.from_model(
        mujoco.MjModel.from_xml_string(f"""
        <mujoco><option integrator="{integrator}"/>
          <worldbody>
            {floating if mocap else ""}
            <body name="bob" pos="0 0 1">
              <joint name="swing" axis="0 1 0"/><geom name="ball" size="0.05" pos="0 0 -0.5" mass="1"/>
              <site name="end" pos="0 0 -0.5"/>
            </body>
          </worldbody>
          {weld if mocap else ""}
          <actuator><motor name="push" joint="swing"/></actuator>
          <sensor><framelinvel objtype="site" objname="end"/><jointpos joint="swing"/></sensor>
          <keyframe><key name="up" qpos="3.14"/></keyframe>
        </mujoco>""")
    )


def state_bytes(physics: Physics) -> bytes:
    state = np.empty(mujoco.mj_stateSize(physics.model, INTEGRATION))
    mujoco.mj_getState(physics.model, physics.data, state, INTEGRATION)
    return state.tobytes()


class ForwardCounter:
    """Counts forward passes."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.count = 0
        forward = mujoco.mj_forward

        def counted(model: Any, data: Any) -> None:
            self.count += 1
            forward(model, data)

        monkeypatch.setattr(mujoco, "mj_forward", counted)


@pytest.fixture
def passes(monkeypatch: pytest.MonkeyPatch) -> ForwardCounter:
    return ForwardCounter(monkeypatch)


def test_a_write_is_followed_by_one_pass_at_the_next_derived_read(passes: ForwardCounter) -> None:
    arena, arm, hand = jaco_parts()
    physics = Physics.from_entity(arena)
    site, joints = physics.bind(hand.pinch_site), physics.bind(arm.joints)
    before = site.xpos.copy()
    passes.count = 0

    joints.qpos = HOME
    np.testing.assert_array_equal(joints.qpos, HOME)
    _ = joints.qvel, physics.bind(arm.actuators).ctrl, joints.range
    assert passes.count == 0
    after = site.xpos.copy()
    assert passes.count == 1
    _ = site.xmat, physics.bind(arm.joint_torque_sensors).sensordata
    assert passes.count == 1
    assert np.linalg.norm(after - before) > 0.1
    fresh = mujoco.MjData(physics.model)
    fresh.qpos[:] = physics.data.qpos
    mujoco.mj_forward(physics.model, fresh)
    np.testing.assert_allclose(after, fresh.site(hand.pinch_site.name).xpos, rtol=0.0, atol=FRESH)


@pytest.mark.parametrize(
    "write",
    [
        lambda p, arm: p.bind(arm.joints).qpos.__setitem__(2, 1.5),
        lambda p, arm: p.bind(arm.joints).qvel.fill(0.1),
        lambda p, arm: np.copyto(p.bind(arm.joints).qpos, np.ones(6)),
        lambda p, arm: p.bind(arm.actuators).ctrl.__setitem__(slice(None), 0.2),
        lambda p, arm: p.bind(arm.joints).qfrc_applied.__iadd__(1.0),
        lambda p, arm: p.bind(arm.joints[1].parent).xfrc_applied.__setitem__(slice(3, None), 1.0),
        lambda p, arm: p.data.qpos.__setitem__(1, 2.0),
        lambda p, arm: setattr(p.bind(arm.joints), "armature", 3.0),
        lambda p, arm: p.bind(arm.wrist_site).pos.__iadd__(0.1),
    ],
)
def test_every_way_of_writing_is_noticed(write: Any, passes: ForwardCounter) -> None:
    arena, arm, _ = jaco_parts()
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    bound = physics.bind(arm.joints)
    _ = bound.qacc
    passes.count = 0
    _ = bound.qacc
    assert passes.count == 0
    write(physics, arm)
    _ = bound.qacc
    assert passes.count == 1


def test_writes_to_the_model_take_effect() -> None:
    arena, arm, _ = jaco_parts()
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    site = physics.bind(arm.wrist_site)
    before, axes = site.xpos.copy(), site.xmat.reshape(3, 3).copy()
    site.pos = (0.0, 0.0, 0.1)  # the site's frame was its body's: MuJoCo has a shortcut for that
    link = site.xpos - before
    np.testing.assert_allclose(np.linalg.norm(link), 0.1, atol=1e-12)
    np.testing.assert_allclose(link, -0.1 * axes[:, 2], atol=1e-12)  # the link's z is the site's -z


def test_steps_never_start_from_stale_data() -> None:
    """Writing home over q = 0 through the data and stepping must not kick the arm."""
    arena, _, _ = jaco_parts()
    physics = Physics.from_entity(arena)
    physics.data.qpos[:6] = HOME
    physics.data.qpos[6:] = 0.5
    physics.step()
    assert np.abs(physics.data.qvel).max() < 0.01
    physics.step(199)
    fresh = mujoco.MjData(physics.model)
    fresh.qpos[:] = physics.data.qpos
    mujoco.mj_kinematics(physics.model, fresh)
    np.testing.assert_allclose(physics.data.xpos, fresh.xpos, rtol=0.0, atol=FRESH)
    np.testing.assert_allclose(physics.data.site_xmat, fresh.site_xmat, rtol=0.0, atol=FRESH)


@pytest.mark.parametrize("field", ["qpos", "qvel", "qfrc_applied", "xfrc_applied", "mocap_pos", "mocap_quat"])
def test_a_change_through_the_data_equals_forward_then_step(field: str) -> None:
    direct, careful = pendulum(mocap=True), pendulum(mocap=True)
    for physics in (direct, careful):
        physics.step(3)
        getattr(physics.data, field)[...] += 0.2
    careful.forward()
    direct.step(2)
    careful.step(2)
    np.testing.assert_array_equal(direct.data.qpos, careful.data.qpos)
    np.testing.assert_array_equal(direct.data.qvel, careful.data.qvel)


def test_order_of_calls_and_no_pass_between_steps(passes: ForwardCounter) -> None:
    physics, bare = pendulum(), pendulum()
    for each in (physics, bare):
        each.data.qpos[0] = 0.4
        each.forward()
    passes.count = 0
    for n in (1, 5, 20):
        physics.data.ctrl[0] = bare.data.ctrl[0] = 0.1 * n
        physics.step(n)
        mujoco.mj_step2(bare.model, bare.data)
        if n > 1:
            mujoco.mj_step(bare.model, bare.data, n - 1)
        mujoco.mj_step1(bare.model, bare.data)
        assert state_bytes(physics) == state_bytes(bare)
    assert passes.count == 0
    assert physics.time == pytest.approx(26 * 0.002)


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "RK4"])
def test_positions_and_velocity_sensors_belong_to_the_new_state(integrator: str) -> None:
    physics = pendulum(integrator)
    physics.data.qpos[0] = 1.0
    physics.step(7)
    velocity, position = physics.data.sensordata[:3].copy(), float(physics.data.sensordata[3])
    end = physics.data.site("end").xpos.copy()
    assert position == physics.data.qpos[0]
    physics.forward()
    np.testing.assert_allclose(physics.data.sensordata[:3], velocity, rtol=0.0, atol=FRESH)
    np.testing.assert_allclose(physics.data.site("end").xpos, end, rtol=0.0, atol=FRESH)


def test_an_input_whose_square_is_not_finite_is_taken_as_it_is() -> None:
    physics = pendulum()
    physics.data.ctrl[0] = 1e300  # a warning would be an error here
    with contextlib.suppress(PhysicsError):  # whatever MuJoCo makes of it
        physics.step()
    physics.data.ctrl[0] = 0.0
    physics.step()
    assert np.isfinite(physics.data.qpos).all()


def test_a_state_that_is_not_finite_is_refused_and_kept() -> None:
    physics = pendulum()
    physics.data.qvel[0] = np.nan
    with pytest.raises(PhysicsError, match="qvel"):
        physics.step()
    assert np.isnan(physics.data.qvel[0])
    assert physics.data.time == 0.0
    with pytest.raises(PhysicsError, match="not finite"):
        physics.forward()
    physics.data.qvel[0] = 0.0
    physics.data.ctrl[0] = np.inf
    with pytest.raises(PhysicsError, match="ctrl"):
        physics.step()
    physics.data.ctrl[0] = 0.0
    physics.step()


def test_an_instability_is_an_error_and_the_state_is_as_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo writes MUJOCO_LOG.TXT when it warns
    physics = pendulum()
    physics.data.qpos[0] = 0.3
    physics.step()
    physics.data.qvel[0] = 1e13
    position = physics.data.qpos.copy()
    for _ in range(2):
        with pytest.raises(PhysicsError, match="mjWARN_BADQ"):
            physics.step(10)
        assert np.array_equal(physics.data.qvel, [1e13])
        assert np.array_equal(physics.data.qpos, position)
        assert physics.data.time == 0.002
    physics.data.qvel[0] = 0.0
    physics.step(10)


def test_switching_parts_off() -> None:
    physics = pendulum()
    physics.data.qpos[0] = 1.0
    physics.forward()
    swing = float(physics.data.qacc[0])
    assert abs(swing) > 1.0
    with physics.disable("gravity", "actuation"):
        physics.update()
        assert physics.data.qacc[0] == 0.0
        physics.data.ctrl[0] = 5.0
        physics.step(100)
        assert physics.data.qpos[0] == 1.0
    physics.data.ctrl[0] = 0.0
    physics.update()
    assert physics.data.qacc[0] == pytest.approx(swing)
    with pytest.raises(RuntimeError, match="inside"), physics.disable("contact"):
        raise RuntimeError("inside")
    assert physics.model.opt.disableflags == 0
    with pytest.raises(UnknownNameError, match="gravity"), physics.disable("gravitation"):
        pass


def test_reset_time_and_keyframes() -> None:
    physics = pendulum()
    physics.step(50)
    assert physics.time == pytest.approx(0.1)
    assert physics.timestep == 0.002
    physics.reset()
    assert physics.time == 0.0
    assert physics.data.qpos[0] == 0.0
    physics.reset("up")
    assert physics.data.qpos[0] == 3.14
    np.testing.assert_allclose(physics.data.site("end").xpos[2], 1.5, atol=1e-5)
    with pytest.raises(UnknownNameError, match="up"):
        physics.reset("down")
    with pytest.raises(UnknownNameError):
        physics.reset(1)


def test_after_reset_ignores_the_controls() -> None:
    physics = pendulum()
    physics.data.ctrl[0] = 3.0
    physics.after_reset()
    assert physics.data.actuator_force[0] == 0.0
    assert physics.data.ctrl[0] == 3.0


def test_state_goes_back_bit_by_bit() -> None:
    physics = pendulum()
    physics.data.qpos[0] = 0.7
    physics.step(10)
    state = physics.get_state()
    physics.step(20)
    there = state_bytes(physics)
    physics.set_state(state)
    assert state_bytes(physics) == state.tobytes()
    physics.step(20)
    assert state_bytes(physics) == there
    with pytest.raises(InvalidInputError, match="shape"):
        physics.set_state(state[1:])


@pytest.mark.parametrize("duplicate", [Physics.copy, copy.deepcopy])
def test_a_copy_is_independent(duplicate: Callable[[Physics], Physics]) -> None:
    arena, arm, _ = jaco_parts()
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    twin = duplicate(physics)
    twin.step(5)
    twin.bind(arm.joints).damping = 7.0
    assert physics.time == 0.0
    assert physics.bind(arm.joints).damping[0] == 0.01
    np.testing.assert_array_equal(physics.bind(arm.joints).qpos, HOME)


@pytest.mark.parametrize("n", [0, -1, 1.5, True, "2", None])
def test_wrong_numbers_of_steps(n: Any) -> None:
    with pytest.raises(InvalidInputError, match="whole number"):
        pendulum().step(n)


def test_wrong_sources_of_a_physics() -> None:
    with pytest.raises(InvalidInputError, match="MjModel"):
        Physics("arm.xml")
    with pytest.raises(InvalidInputError, match="Entity"):
        Physics.from_entity("arm")  # type: ignore[arg-type]
    arm, hand = JacoArm(), JacoHand()
    arm.attach(hand)
    with pytest.raises(InvalidInputError, match="attached to 'jaco_arm'"):
        Physics.from_entity(hand)


def test_what_mujoco_cannot_compile_is_a_model_error() -> None:
    spec = mujoco.MjSpec()
    spec.worldbody.add_body(name="massless").add_joint(name="joint")
    with pytest.raises(ModelError, match="mass"):
        Physics.from_entity(ModelWrapperEntity(spec))


def test_entities_can_be_used_only_with_a_physics_that_holds_them() -> None:
    physics = pendulum()
    arm, hand = JacoArm(), JacoHand()
    for use in (
        lambda: arm.set_home(physics),
        lambda: arm.randomize_arm_joints(physics, np.random.default_rng(0)),
        lambda: arm.set_site_to_xpos(physics, np.random.default_rng(0), arm.wrist_site, (0.3, 0.0, 0.5)),
        lambda: hand.set_grasp(physics, 0.0),
        lambda: arm.observables.joints_pos(physics),
    ):
        with pytest.raises(InvalidInputError, match="not part of this physics"):
            use()
    not_physics: Any = arm
    with pytest.raises(InvalidInputError, match=r"made by Physics\.from_entity"):
        arm.set_home(not_physics)


def test_free_props_can_be_observed() -> None:
    options = observations.make_options(observations.PERFECT_FEATURES, observations.FREEPROP_OBSERVABLES)
    ball = Primitive("sphere", (0.03,), mass=0.2, observable_options=options)
    arena = Arena()
    arena.add_free_entity(ball, position=(0.1, 0.2, 1.0))
    physics = Physics.from_entity(arena)
    assert sorted(ball.observables.as_dict()) == [
        f"primitive/{name}" for name in ("angular_velocity", "linear_velocity", "orientation", "position")
    ]
    assert all(each.enabled for each in ball.observables.as_dict().values())
    np.testing.assert_allclose(ball.observables.position(physics), (0.1, 0.2, 1.0), atol=1e-12)
    ball.set_pose(physics, position=(0.0, 0.0, 2.0), quaternion=(0.0, 1.0, 0.0, 0.0))
    np.testing.assert_allclose(ball.observables.orientation(physics), (0.0, 1.0, 0.0, 0.0), atol=1e-12)
    physics.step(50)
    # 0.1 s of free fall; semi-implicit Euler gives v = g t exactly
    np.testing.assert_allclose(ball.observables.linear_velocity(physics), (0.0, 0.0, -0.981), atol=1e-9)
    np.testing.assert_allclose(ball.observables.angular_velocity(physics), 0.0, atol=1e-9)
    with pytest.raises(UnknownNameError, match="box"):
        Primitive("cube")
    with pytest.raises(InvalidInputError, match="size"):
        Primitive("box", (0.1,))


def test_one_tree_makes_several_independent_simulations() -> None:
    arena, _, _ = jaco_parts()
    first, second = Physics.from_entity(arena), Physics.from_entity(arena)
    first.step(3)
    assert second.time == 0.0


def test_a_trial_pose_computed_by_hand_is_made_good_by_refresh() -> None:
    """MuJoCo's own functions may be run on the data; the state alone does not tell that they were."""
    physics = pendulum()
    physics.data.qpos[0] = 0.3
    end = physics.bind("end")
    before = end.xpos.copy()
    physics.data.qpos[0] = 1.5
    mujoco.mj_kinematics(physics.model, physics.data)
    physics.data.qpos[0] = 0.3
    physics.refresh()
    np.testing.assert_array_equal(end.xpos, before)


def test_update_computes_only_what_is_due(passes: ForwardCounter) -> None:
    physics = pendulum()
    physics.data.qpos[0] = 0.3
    physics.update()
    fresh = physics.data.site("end").xpos.copy()
    count = passes.count
    physics.update()
    assert passes.count == count
    physics.refresh()
    assert passes.count == count + 1
    np.testing.assert_array_equal(physics.data.site("end").xpos, fresh)
