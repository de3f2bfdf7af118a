"""Randomization: drawn from the environment's numbers, reported, replayed, refused where it is impossible."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.envs.mujoco.utils import check_mujoco_reset_state
from gymnasium.envs.registration import EnvSpec

import jacokin
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.mujoco_bridge.distributions import Normal, Uniform
from jacokin.tasks import Randomization, TaskEnv
from tests.tasks.gym.randomizations import ALL


def episode(environment: TaskEnv, **reset: Any) -> tuple[list[Any], dict[str, float]]:
    observation, info = environment.reset(**reset)
    observations = [observation, *(environment.step(np.full(9, 0.2))[0] for _ in range(4))]
    return observations, info["randomization"]


def test_values_are_drawn_reported_and_replayed() -> None:
    environment = TaskEnv("lift_brick", randomization=ALL)
    first, values = episode(environment, seed=1)
    _, others = episode(environment)
    assert all(values[name] != others[name] for name in values)
    model = environment.model
    before = model.body_mass.copy(), model.geom_friction.copy()
    again, same = episode(environment, seed=1)
    assert same == values
    np.testing.assert_array_equal(again, first)
    assert not np.array_equal(model.body_mass, before[0])
    assert not np.array_equal(model.geom_friction, before[1])
    _, replayed = episode(environment, seed=5, options={"randomization": values})
    assert replayed == values
    plain = TaskEnv("lift_brick").model
    brick = int(np.flatnonzero(model.jnt_type == 0)[0])
    body = model.jnt_bodyid[brick]
    assert model.body_mass[body] == pytest.approx(values["mass"] * plain.body_mass[body])
    assert model.actuator_gainprm[0, 0] == pytest.approx(values["gains"] * values["joint_gain_1"] * 500.0)
    np.testing.assert_allclose(model.dof_damping[:6], values["damping"] * plain.dof_damping[:6])
    rest = np.setdiff1d(np.arange(body), model.jnt_bodyid[:6])  # links have factors of their own
    np.testing.assert_array_equal(model.body_mass[rest], plain.body_mass[rest])


def test_copies_keep_the_values() -> None:
    environment = TaskEnv("place_cradle", randomization=ALL)
    episode(environment, seed=2)
    copies = [pickle.loads(pickle.dumps(environment)), copy.deepcopy(environment)]
    for _ in range(4):
        observation, _, _, _, info = environment.step(np.full(9, -0.3))
        for each in copies:
            other, _, _, _, others = each.step(np.full(9, -0.3))
            np.testing.assert_array_equal(other, observation)
            assert others == info
    check_mujoco_reset_state(environment)  # type: ignore[arg-type]  # has `model` and `data` as a MujocoEnv


def test_actions_come_late() -> None:
    late, prompt = TaskEnv("reach_site", randomization=Randomization(latency=0.08)), TaskEnv("reach_site")
    late.reset(seed=0)
    prompt.reset(seed=0)
    for _ in range(2):
        late.step(np.ones(9))
        prompt.step(np.zeros(9))
    for _ in range(2):
        np.testing.assert_array_equal(late.step(np.zeros(9))[0], prompt.step(np.ones(9))[0])


def test_actions_come_in_the_middle_of_a_step() -> None:
    late = TaskEnv("reach_site", randomization=Randomization(latency=0.054))  # 27 physics steps of 0.002 s
    plain = TaskEnv("reach_site")
    late.reset(seed=0)
    plain.reset(seed=0)
    physics, asked = plain.task.physics, [0.3 * np.sin(np.arange(9.0) + step) for step in range(5)]
    for step, action in enumerate(asked):
        late.step(action)
        for substep in range(20 * step, 20 * step + 20):
            given = (substep - 27) // 20  # brute force: physics steps one by one
            physics.data.ctrl[:] = asked[given] if given >= 0 else 0.0
            physics.step()
        np.testing.assert_array_equal(late.data.qpos, physics.data.qpos)
        np.testing.assert_array_equal(late.data.qvel, physics.data.qvel)


@pytest.mark.one_quick
@pytest.mark.parametrize("delay", [0.0, 0.014, 0.04, 0.094])
def test_observations_come_late(delay: float) -> None:
    late = TaskEnv("lift_brick", goal=True, randomization=Randomization(observation_delay=delay))
    plain = TaskEnv("lift_brick", goal=True)
    first: Any = plain.reset(seed=0)[0]
    np.testing.assert_equal(late.reset(seed=0)[0], first)
    seen = [first]  # of each physics step
    for step in range(4):
        action = np.sin(np.arange(9.0) + step)
        observation, reward, *_ = late.step(action)
        plain.data.ctrl[:] = np.clip(action, *plain._control.bounds)
        for _ in range(20):
            plain.task.physics.step()
            seen.append(plain._packing.pack(plain._episode.state))
        np.testing.assert_equal(observation, seen[max(0, len(seen) - 1 - round(delay / 0.002))])
        assert reward == plain.compute_reward(seen[-1]["achieved_goal"], seen[-1]["desired_goal"])


def test_copies_see_late_too() -> None:
    varied = Randomization(
        latency=0.05, observation_delay=0.09, feature_noise={"target_position": 0.1}, arm_push=20.0, push_rate=15.0
    )
    environment = TaskEnv("reach_site", randomization=varied)
    environment.reset(seed=0)
    for _ in range(3):
        environment.step(np.full(9, 0.3))
    for twin in (copy.deepcopy(environment), pickle.loads(pickle.dumps(environment))):
        ahead = copy.deepcopy(environment)
        for _ in range(4):
            np.testing.assert_array_equal(twin.step(np.zeros(9))[0], ahead.step(np.zeros(9))[0])


@pytest.mark.slow
def test_each_feature_has_its_own_noise() -> None:
    noise: dict[str, Any] = {"duplo2x4/position": 0.05, "jaco_arm/joints_pos": Normal(0.01, 0.0)}
    varied = Randomization(feature_noise=noise)
    noisy, clean = (TaskEnv("lift_brick", flatten=False, randomization=each) for each in (varied, None))
    found: dict[str, list[Any]] = {}
    for seed in range(40):
        one: Any = noisy.reset(seed=seed)[0]
        other: Any = clean.reset(seed=seed)[0]
        for name in one:
            found.setdefault(name, []).append(one[name] - other[name])
    for name, values in found.items():
        deviation = {"duplo2x4/position": 0.05, "jaco_arm/joints_pos": 0.01}.get(name, 0.0)
        assert np.std(values) == pytest.approx(deviation, rel=0.25), name
    goals = TaskEnv("reach_site", goal=True, randomization={"feature_noise": {"achieved_goal": 0.1}})
    one, other = goals.reset(seed=0)[0], TaskEnv("reach_site", goal=True).reset(seed=0)[0]
    assert np.abs(one["achieved_goal"] - other["achieved_goal"]).max() > 0.01
    np.testing.assert_array_equal(one["observation"], other["observation"])
    with pytest.raises(
        UnknownNameError, match=r"unknown feature 'duplo2x4/positio'\. Did you mean 'duplo2x4/position'"
    ):
        TaskEnv("lift_brick", randomization=Randomization(feature_noise={"duplo2x4/positio": 0.1}))
    for wrong in ({"a": -1.0}, {1: 0.1}, 0.1, {"a": "b"}, {"a": {"from": 1}}):
        with pytest.raises(InvalidInputError, match="feature_noise"):
            Randomization(feature_noise=wrong)  # type: ignore[arg-type]
    assert varied.scaled(0.5).feature_noise == {"duplo2x4/position": 0.025, "jaco_arm/joints_pos": Normal(0.005, 0.0)}


def test_noise_is_on_all_that_is_observed() -> None:
    noisy = TaskEnv("reach_site", goal=True, randomization=Randomization(observation_noise=0.1))
    clean = TaskEnv("reach_site", goal=True)
    one: Any = noisy.reset(seed=0)[0]
    other: Any = clean.reset(seed=0)[0]
    for key in ("observation", "achieved_goal"):
        assert 0.01 < np.abs(one[key] - other[key]).mean() < 0.3
    np.testing.assert_array_equal(one["desired_goal"], other["desired_goal"])
    assert noisy.step(np.ones(9))[1] == clean.step(np.ones(9))[1]


@pytest.mark.one_quick
@pytest.mark.parametrize(
    "varied",
    [
        Randomization(mass=Uniform(0.5, 2.0), gains=Uniform(0.8, 1.2)),
        Randomization(latency=0.04, observation_noise=0.1, camera=0.05, lights=Uniform(0.5, 1.5)),
        Randomization(action_noise=0.1, observation_bias=0.1, colors=0.2, link_masses=Uniform(0.8, 1.2)),
        Randomization(joint_offsets=Uniform(-0.05, 0.05)),
        Randomization(feature_bias={"target_position": Uniform(0.0, 0.1)}, textures=Uniform(0.5, 2.0)),
        Randomization(observation_delay=0.05, latency=0.03, feature_noise={"target_position": Uniform(0.0, 0.1)}),
        Randomization(joint_gains=Uniform(0.8, 1.2), armature=2.0, dry_friction=0.5, field_of_view=0.9, ambient=0.5),
    ],
)
def test_initial_states_are_those_without_randomization(varied: Randomization) -> None:
    with_it, without = TaskEnv("reach_site", randomization=varied), TaskEnv("reach_site")
    for seed in (7, None):
        with_it.reset(seed=seed)
        without.reset(seed=seed)
        np.testing.assert_array_equal(with_it.data.qpos, without.data.qpos)
        np.testing.assert_array_equal(with_it.data.mocap_pos, without.data.mocap_pos)
        with_it.step(np.ones(9))  # noise is drawn


def test_specifications_with_randomization_survive_json() -> None:
    noise = Normal(0.01, 0.001)
    varied = Randomization(
        mass=Uniform(0.5, 2.0),
        observation_noise=noise,
        base_pose=np.full(4, 0.01),
        feature_noise={"target_position": noise},
    )
    environment = gymnasium.make("jacokin/ReachSite-v0", randomization=varied, goal=True)
    assert environment.spec is not None
    again: Any = gymnasium.make(EnvSpec.from_json(environment.spec.to_json()))
    assert again.unwrapped.randomization == varied
    np.testing.assert_equal(again.reset(seed=3), environment.reset(seed=3))
    environment.close()
    again.close()


def test_the_base_is_where_it_was_drawn() -> None:
    environment = TaskEnv("reach_site", control="tool_pose", randomization=Randomization(base_pose=Uniform(-0.1, 0.1)))
    data, base = environment.data, environment.model.body("jaco_arm/link_base").id
    angles = []
    for seed in range(3):
        _, info = environment.reset(seed=seed)
        values = info["randomization"]
        x, y, z, yaw = (values[f"base_{name}"] for name in ("x", "y", "z", "yaw"))
        np.testing.assert_allclose(data.xpos[base], (x, 0.4 + y, z), rtol=0.0, atol=1e-12)
        turn = [[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]]
        np.testing.assert_allclose(data.xmat[base].reshape(3, 3), turn, rtol=0.0, atol=1e-12)
        angles.append(yaw)
        # The tool starts where it would with the arm in its place: within its box, pointing down.
        tool = environment._episode.task._tool
        assert (np.abs(data.site_xpos[tool] - (0.0, 0.0, 0.21)) <= (0.2, 0.2, 0.19)).all()
        np.testing.assert_allclose(data.site_xmat[tool].reshape(3, 3)[:, 2], (0.0, 0.0, -1.0), rtol=0.0, atol=1e-5)
    assert len(set(angles)) == 3
    # Poses of the tool are meant in the world, wherever the arm stands.
    goal = np.array([0.05, 0.1, 0.3, *jacokin.mujoco_bridge.DOWN_QUATERNION, 0.5])
    for _ in range(200):
        environment.step(goal)
    np.testing.assert_allclose(data.site_xpos[tool], goal[:3], rtol=0.0, atol=0.003)
    moved = TaskEnv("reach_site", randomization=Randomization(base_pose=(0.01, 0.02, 0.0, 0.1)))
    assert moved.reset(seed=0)[1]["randomization"] == {"base_x": 0.01, "base_y": 0.02, "base_z": 0.0, "base_yaw": 0.1}


def test_velocities_of_the_tool_are_meant_in_the_world() -> None:
    turned = Randomization(base_pose=(0.0, 0.0, 0.0, 0.3))
    environment = TaskEnv("reach_site", control="tool_velocity", randomization=turned)
    environment.reset(seed=0)
    view, tool = environment._episode.view, environment.task.tool
    before = tool(view).copy()
    for _ in range(25):
        environment.step(np.array([0.0, 0.05, 0.05, 0.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(tool(view) - before, (0.0, 0.05, 0.05), rtol=0.0, atol=0.005)


def test_offsets_of_joints_turn_the_arm() -> None:
    """Pinocchio's arm at the true angles has its tool where MuJoCo's has it at those that are measured."""
    offsets = np.array((0.05, -0.1, 0.08, 0.2, -0.15, 0.1))
    environment = TaskEnv("reach_site", randomization=Randomization(joint_offsets=offsets), flatten=False)
    robot, home = jacokin.load_robot(), TaskEnv("reach_site").task.physics
    for seed in range(3):
        observation, info = environment.reset(seed=seed)
        assert isinstance(observation, dict)
        assert [info["randomization"][f"joint_offset_{number}"] for number in range(1, 7)] == offsets.tolist()
        measured = environment.data.qpos[:6].copy()
        base = home.bind(environment.task.arm.root_body.name).xpos
        true = robot.forward_kinematics(measured + offsets, "pinchsite").translation + np.ravel(base)
        np.testing.assert_allclose(observation["jaco_arm/jaco_hand/pinch_site_pos"], true, atol=1e-6)
        nominal = robot.forward_kinematics(measured, "pinchsite").translation + np.ravel(base)
        assert np.linalg.norm(nominal - true) > 0.02
        pairs = observation["jaco_arm/joints_pos"]
        np.testing.assert_allclose(pairs, np.stack((np.sin(measured), np.cos(measured)), axis=1))


def test_each_joint_and_link_has_its_own_factor() -> None:
    factors = np.linspace(0.7, 1.3, 6)
    gains = np.linspace(0.6, 1.4, 9)
    varied = Randomization(link_masses=factors, joint_gains=gains, armature=1.5, dry_friction=0.5)
    one, other = TaskEnv("lift_brick", randomization=varied), TaskEnv("lift_brick")
    one.reset(seed=1)
    other.reset(seed=1)
    links = other.model.jnt_bodyid[:6]
    np.testing.assert_allclose(one.model.body_mass[links], factors * other.model.body_mass[links])
    brick = other.task.props[0].root_body.id
    assert one.model.body_mass[brick] == other.model.body_mass[brick]
    # Of the same mechanism, the mass matrices differ by the added inertia of the motors and the weight of the links.
    matrices = []
    for each in (one, other):
        each.data.qpos[:] = other.data.qpos
        mujoco.mj_forward(each.model, each.data)
        full = np.zeros((each.model.nv, each.model.nv))
        mujoco.mj_fullM(each.model, each.data, full)
        matrices.append(full)
    fingers = slice(6, 9)  # whose links keep their masses
    np.testing.assert_allclose(
        np.diag(matrices[0] - matrices[1])[fingers], 0.5 * other.model.dof_armature[fingers], rtol=1e-9
    )
    np.testing.assert_allclose(one.model.dof_frictionloss[:9], 0.5 * other.model.dof_frictionloss[:9])
    speeds = np.full(9, 0.01)
    for each in (one, other):
        each.data.qvel[:] = 0.0
        each.data.ctrl[:] = speeds
        mujoco.mj_forward(each.model, each.data)
    np.testing.assert_allclose(one.data.actuator_force, gains * other.data.actuator_force)


def test_actions_are_noisy_within_the_limits_of_the_actuators() -> None:
    environment = TaskEnv("reach_site", randomization=Randomization(action_noise=0.1))
    environment.reset(seed=0)
    sent = []
    for _ in range(60):
        environment.step(np.zeros(9))
        sent.append(environment.data.ctrl.copy())
    values = np.array(sent)
    assert 0.09 < values.std() < 0.11
    assert np.abs(values.mean(axis=0)).max() < 0.06
    environment.step(np.full(9, 100.0))
    assert (environment.data.ctrl <= environment.model.actuator_ctrlrange[:, 1]).all()


@pytest.mark.slow
def test_pushes_have_their_force_and_last_their_time() -> None:
    varied = Randomization(arm_push=10.0, prop_push=0.05, push_rate=2.0, push_duration=0.12)
    environment = TaskEnv("lift_brick", randomization=varied)
    environment.reset(seed=0)
    model = environment.model
    links, brick = set(model.jnt_bodyid[:6].tolist()), model.body("duplo2x4/").id
    assert not environment.data.xfrc_applied.any()  # none goes on from an episode to the next, or begins at a reset
    begun, lasted, pushed = {10.0: 0, 0.05: 0}, list[int](), set[int]()
    before: dict[int, Any] = {}
    for _ in range(500):
        if environment._episode.is_over:
            environment.reset()
            before = {}
        environment.step(np.zeros(9))
        forces = environment.data.xfrc_applied
        assert not forces[:, 3:].any()
        now = {}
        for body in np.flatnonzero(forces.any(axis=1)).tolist():
            size, (force, count) = 10.0 if body in links else 0.05, before.get(body, (None, 0))
            assert body in links or body == brick
            np.testing.assert_allclose(np.linalg.norm(forces[body]), size)
            is_same = force is not None and np.array_equal(force, forces[body])
            begun[size] += not is_same
            now[body] = forces[body].copy(), count + 1 if is_same else 1
        for body, (force, count) in before.items():
            if body not in now or not np.array_equal(force, now[body][0]):
                lasted.append(count)
                pushed.add(body)
        before = now
    assert set(lasted) == {3}
    # 20 s with a push of 0.12 s every 0.5 s + 0.12 s on average: 32.
    assert all(18 <= count <= 48 for count in begun.values())
    assert len(pushed & links) >= 5


def test_a_push_moves_what_it_pushes() -> None:
    """A brick that is pushed upwards by more than its weight leaves the table."""
    environment = TaskEnv("lift_brick", randomization=Randomization(prop_push=1.0, push_rate=25.0, push_duration=0.04))
    environment.reset(seed=0)
    brick = environment.model.body("duplo2x4/").id
    mass, physics = float(environment.model.body_mass[brick]), environment.task.physics
    velocity = physics.data.qvel[-6:-3]
    before = velocity.copy()
    while environment.data.xfrc_applied[brick, 2] < 0.5:
        before = velocity.copy()
        environment.step(np.zeros(9))
    gained = (velocity - before)[2]
    force = environment.data.xfrc_applied[brick, 2] - 9.81 * mass
    assert gained == pytest.approx(force * environment.dt / mass, rel=0.2)


def test_a_bias_stays_all_through_an_episode() -> None:
    biased = TaskEnv("reach_site", goal=True, randomization=Randomization(observation_bias=0.1))
    clean = TaskEnv("reach_site", goal=True)

    def differences(seed: int) -> tuple[Any, ...]:
        one: Any = [biased.reset(seed=seed)[0], *(biased.step(np.zeros(9))[0] for _ in range(2))]
        other: Any = [clean.reset(seed=seed)[0], *(clean.step(np.zeros(9))[0] for _ in range(2))]
        for before, after in zip(one, other, strict=True):
            np.testing.assert_array_equal(before["desired_goal"], after["desired_goal"])
        return tuple(
            np.array([a[key] - b[key] for a, b in zip(one, other, strict=True)])
            for key in ("observation", "achieved_goal")
        )

    features, achieved = differences(0)
    for each in (features, achieved):
        np.testing.assert_allclose(each, each[:1].repeat(3, axis=0), atol=1e-12)
    assert 0.07 < features[0].std() < 0.13
    assert not np.allclose(differences(1)[0][0], features[0])


def test_the_bias_of_a_feature_is_on_that_alone() -> None:
    bias: dict[str, Any] = {"target_position": 0.1, "achieved_goal": Uniform(0.02, 0.05)}
    biased = TaskEnv("reach_site", goal=True, randomization=Randomization(feature_bias=bias))
    clean = TaskEnv("reach_site", goal=True)
    drawn = []
    for seed in range(40):
        one: Any = [biased.reset(seed=seed)[0], biased.step(np.zeros(9))[0]]
        other: Any = [clean.reset(seed=seed)[0], clean.step(np.zeros(9))[0]]
        added = np.array([a["observation"] - b["observation"] for a, b in zip(one, other, strict=True)])
        np.testing.assert_allclose(added[0], added[1], atol=1e-12)
        assert (added[:, 3:] == 0.0).all()  # the target is observed first
        drawn.append(added[0, :3])
        first, second = (a["achieved_goal"] - b["achieved_goal"] for a, b in zip(one, other, strict=True))
        np.testing.assert_allclose(first, second, atol=1e-12)
        assert np.abs(first).min() > 0.0
    assert 0.08 < np.std(drawn) < 0.12
    with pytest.raises(UnknownNameError, match="unknown feature 'target'"):
        TaskEnv("reach_site", randomization=Randomization(feature_bias={"target": 0.1}))
    with pytest.raises(InvalidInputError, match="feature_bias"):
        Randomization(feature_bias={"target_position": -0.1})


def test_what_is_drawn_of_pictures_does_not_touch_the_simulation() -> None:
    varied = Randomization(ambient=0.5, field_of_view=0.9, colors=0.3, textures=2.0, camera_turn=0.1)
    one, other = TaskEnv("lift_brick", randomization=varied), TaskEnv("lift_brick")
    np.testing.assert_array_equal(one.reset(seed=0)[0], other.reset(seed=0)[0])
    np.testing.assert_allclose(one.model.vis.headlight.ambient, 0.5 * other.model.vis.headlight.ambient)
    np.testing.assert_allclose(one.model.mat_texrepeat, 2.0 * other.model.mat_texrepeat)
    assert (other.model.mat_texrepeat > 0.0).any()
    camera = one.model.camera("front_close").id
    assert one.model.cam_fovy[camera] == pytest.approx(0.9 * other.model.cam_fovy[camera])
    cosine = abs(float(one.model.cam_quat[camera] @ other.model.cam_quat[camera]))
    assert 2.0 * np.arccos(cosine) == pytest.approx(0.1)
    moved = np.flatnonzero((one.model.geom_rgba != other.model.geom_rgba).any(axis=1))
    bodies = {one.model.body(int(one.model.geom_bodyid[geom])).name for geom in moved}
    assert bodies <= {"duplo2x4/", "world"}
    assert "duplo2x4/" in bodies
    assert np.linalg.norm((one.model.geom_rgba - other.model.geom_rgba)[moved], axis=1).max() <= 0.3 + 1e-6
    one.reset(seed=1)
    assert one.model.cam_fovy[camera] == pytest.approx(0.9 * other.model.cam_fovy[camera])  # not 0.9 of 0.9


def test_a_curriculum_widens_the_ranges() -> None:
    whole = Randomization(
        mass=Uniform(0.5, 2.0), friction=0.4, base_pose=Uniform(-0.02, 0.02), action_noise=Normal(0.1, 0.02)
    )
    assert whole.scaled(1.0) == whole
    none = whole.scaled(0.0)
    assert none == Randomization(
        mass=Uniform(1.0, 1.0), friction=1.0, base_pose=Uniform(0.0, 0.0), action_noise=Normal(0.0, 0.0)
    )
    half = whole.scaled(0.5)
    assert half == Randomization(
        mass=Uniform(0.75, 1.5), friction=0.7, base_pose=Uniform(-0.01, 0.01), action_noise=Normal(0.05, 0.01)
    )
    envs: Any = gymnasium.make_vec(
        "jacokin/LiftBrick-v0", num_envs=3, vectorization_mode="vector_entry_point", randomization=none
    )
    drawn = [np.asarray(envs.reset(seed=0)[1]["randomization"]["mass"])]
    envs.randomization = half
    drawn.append(np.asarray(envs.reset(seed=0)[1]["randomization"]["mass"]))
    assert (drawn[0] == 1.0).all()
    assert ((drawn[1] > 0.75) & (drawn[1] < 1.5)).all()
    assert len(set(drawn[1])) == 3
    with pytest.raises(InvalidInputError, match="must draw the same quantities"):
        envs.randomization = Randomization(mass=1.0)
    with pytest.raises(InvalidInputError, match="part must be in 0..1"):
        whole.scaled(1.5)
    with pytest.raises(InvalidInputError, match="mass is a sampler other than"):
        Randomization(mass=lambda *_: 1.0).scaled(0.5)


def test_what_physics_does_not_allow_is_refused() -> None:
    for wrong in (
        *({"mass": 0.0}, {"friction": -1.0}, {"latency": 2.0}, {"observation_noise": np.nan}, {"gains": "big"}),
        *({"base_pose": 0.6}, {"base_pose": (0.0, 0.0, 0.0, 4.0)}, {"base_pose": (0.0, 0.0)}, {"base_pose": "left"}),
        *({"base_pose": np.full(4, np.inf)}, {"mass": ((1.0,), (1.0, 1.0))}, {"camera": -0.1}, {"lights": np.inf}),
        *({"camera": 5.0}, {"joint_offsets": 0.6}, {"joint_offsets": np.zeros(5)}, {"joint_gains": 0.0}),
        *({"link_masses": -1.0}, {"colors": 1.5}, {"action_noise": -0.1}, {"armature": 0.0}),
        *({"camera_turn": 0.6}, {"arm_push": -1.0}, {"push_duration": np.inf}),
    ):
        with pytest.raises(InvalidInputError):
            Randomization(**wrong)
    environment = TaskEnv("reach_site", randomization=Randomization(mass=Uniform(-2.0, -1.0)))
    with pytest.raises(InvalidInputError, match="mass must be a factor above 0"):
        environment.reset(seed=0)
    environment = TaskEnv("reach_site", randomization=Randomization(mass=2.0))
    with pytest.raises(UnknownNameError, match="Valid: mass"):
        environment.reset(options={"randomization": {"weight": 1.0}})
    with pytest.raises(InvalidInputError, match="lacks mass"):
        environment.reset(options={"randomization": {}})
    with pytest.raises(InvalidInputError, match="must be a Randomization"):
        TaskEnv("reach_site", randomization=2.0)  # type: ignore[arg-type]  # the mistake
    with pytest.raises(UnknownNameError, match="Valid: friction"):
        TaskEnv("reach_site", randomization={"weight": 2.0})
    with pytest.raises(InvalidInputError, match="mass must be a number, a sampler, or its arguments"):
        Randomization(mass={"low": 1.0, "scale": 2.0})
