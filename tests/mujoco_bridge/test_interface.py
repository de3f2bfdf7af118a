"""Programs written against the interface that the bridge follows, with nothing changed but the imports."""

from __future__ import annotations

import ast
from pathlib import Path

import mujoco
import numpy as np
import pytest

import jacokin.mujoco_bridge
from jacokin.errors import JacokinError
from jacokin.model.descriptions import bundled
from jacokin.mujoco_bridge import (
    Arena,
    Physics,
    Primitive,
    TcpInitializer,
    base,
    cameras,
    command_joint_positions,
    command_site_velocity,
    jaco_arm,
    jaco_hand,
    observations,
    robots,
)

PACKAGE = Path(jacokin.mujoco_bridge.__file__).parent


class MyArm(base.RobotArm):
    """The smallest arm of one's own: a spec, its joints, its wrist."""

    def _build(self) -> None:
        self._mjcf_root = mujoco.MjSpec.from_file(str(bundled.urdf_folder() / "jaco_arm.xml"))
        self._joints = [self._mjcf_root.joint(f"joint_{i}") for i in range(1, 7)]
        self._wrist_site = self._mjcf_root.site("wristsite")

    @property
    def joints(self) -> list[mujoco.MjsJoint]:
        return self._joints

    @property
    def wrist_site(self) -> mujoco.MjsSite:
        return self._wrist_site


def test_an_arm_of_ones_own_is_randomized_moved_and_observed() -> None:
    arm = MyArm()
    physics = Physics.from_entity(arm)
    rng = np.random.RandomState(42)

    # Randomize joint positions within valid bounds
    arm.randomize_arm_joints(physics, rng)

    # Move arm so that wrist_site reaches a target position
    success = arm.set_site_to_xpos(
        physics,
        rng,
        site=arm.wrist_site,
        target_pos=[0.5, 0.0, 0.3],
        target_quat=base.DOWN_QUATERNION,
        max_ik_attempts=10,
    )
    assert success
    np.testing.assert_allclose(physics.bind(arm.wrist_site).xpos, (0.5, 0.0, 0.3), rtol=0.0, atol=1e-6)

    # Access standard observables
    obs = arm.observables
    joint_positions = obs.joints_pos(physics)
    joint_velocities = obs.joints_vel(physics)
    np.testing.assert_array_equal(joint_positions, physics.bind(arm.joints).qpos)
    np.testing.assert_array_equal(joint_velocities, np.zeros(6))
    assert isinstance(obs, base.JointsObservables)


def test_the_arm_and_the_hand_of_the_tasks(capsys: pytest.CaptureFixture[str]) -> None:
    # Create arm and hand with perfect-features observation settings.
    obs_settings = observations.PERFECT_FEATURES
    arm = robots.make_arm(obs_settings)
    hand = robots.make_hand(obs_settings)

    # Inspect the arm's joints and actuators.
    print("Arm joints:", [j.name for j in arm.joints])
    print("Arm actuators:", [a.name for a in arm.actuators])
    joints = "['joint_1', 'joint_2', 'joint_3', 'joint_4', 'joint_5', 'joint_6']"
    assert capsys.readouterr().out == f"Arm joints: {joints}\nArm actuators: {joints}\n"

    # Attach hand to arm at the wrist site.
    arm.attach(hand)
    print("Hand actuators:", [a.name for a in hand.actuators])
    assert "'jaco_hand/finger_1', 'jaco_hand/finger_2', 'jaco_hand/finger_3'" in capsys.readouterr().out
    assert hand.tool_center_point is hand.pinch_site
    assert all(observable.enabled for observable in arm.observables.as_dict().values())


def test_a_hand_made_directly() -> None:
    # Direct instantiation of JacoHand with pinch site as TCP.
    hand = jaco_hand.JacoHand(use_pinch_site_as_tcp=True)
    assert hand.tool_center_point.name == "pinchsite"
    assert len(hand.joints) == 3


def test_settings_reach_the_observables() -> None:
    arm = robots.make_arm(observations.PERFECT_FEATURES)
    hand = robots.make_hand(observations.VISION)
    arm.attach(hand)
    arena = Arena()
    arena.attach(arm, position=robots.ARM_OFFSET)
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    plain = jaco_arm.JacoArm(name="plain")
    assert not any(observable.enabled for observable in plain.observables.as_dict().values())
    raw = np.vecdot(physics.bind(arm.joint_torque_sensors).sensordata, physics.bind(arm.joints).axis)
    logarithmic = np.sign(raw) * np.log1p(np.abs(raw))
    np.testing.assert_allclose(arm.observables.joints_torque(physics), logarithmic, rtol=1e-14)
    assert np.abs(raw).max() > 1.0
    assert sorted(hand.observables.as_dict()) == [
        f"jaco_arm/jaco_hand/{name}" for name in ("joints_pos", "joints_vel", "pinch_site_pos", "pinch_site_rmat")
    ]
    assert robots.ARM_OFFSET == (0.0, 0.4, 0.0)
    np.testing.assert_array_equal(base.DOWN_QUATERNION, (0.0, 0.70710678118, 0.70710678118, 0.0))
    assert robots.DOWN_QUATERNION is base.DOWN_QUATERNION
    assert cameras.FRONT_CLOSE.name == "front_close"


def test_public_names() -> None:
    assert jacokin.mujoco_bridge.__all__ == [
        "Arena",
        "ArraySpec",
        "BoxProp",
        "Brick",
        "Cradle",
        "DOWN_QUATERNION",
        "Entity",
        "JacoArm",
        "JacoHand",
        "JointsObservables",
        "MJCFFeature",
        "ModelWrapperEntity",
        "Observable",
        "Observables",
        "Pedestal",
        "Physics",
        "Primitive",
        "PropPlacer",
        "RobotArm",
        "RobotHand",
        "TcpInitializer",
        "ToolCenterPointInitializer",
        "Updater",
        "angles_from_sin_cos",
        "base",
        "cameras",
        "command_joint_positions",
        "command_site_velocity",
        "distributions",
        "jaco_arm",
        "jaco_hand",
        "large_box",
        "observable",
        "observables_of",
        "observations",
        "props",
        "rewards",
        "robots",
        "uniform_box",
        "workspaces",
    ]


def test_what_is_no_physics_entity_or_name_is_refused_by_name() -> None:
    arm, arena = jaco_arm.JacoArm(), Arena()
    arena.attach(arm)
    physics = Physics.from_entity(arena)
    for refused, words in (
        (lambda: arm.observables.joints_pos(None), "must be a Physics"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: arm.get_pose(None), "must be a Physics"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: arm.set_pose(None, [0.0, 0.0, 0.0]), "must be a Physics"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: Physics.from_entity(Arena), "must be an Entity"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: jaco_arm.JacoArm(3), "name must be a string"),
        (lambda: jaco_hand.JacoHand(name=3), "name must be a string"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: Arena(name=b"hall"), "name must be a string"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: robots.make_arm(None), "obs_settings"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: robots.make_hand("VISION"), "obs_settings"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: observations.make_options(observations.VISION, ["joints_pos"]), "obs_names"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: cameras.add_camera_observables(None, observations.VISION, cameras.TOP_DOWN), "must be an Entity"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: physics.set_state("here"), "state must be"),
        (lambda: physics.disable(["contact"]).__enter__(), "unknown flag"),  # type: ignore[arg-type]  # wrong on purpose
    ):
        with pytest.raises(JacokinError, match=words):
            refused()
    assert arena.mjcf_model.camera(cameras.TOP_DOWN.name) is None


def test_commands_starts_and_props_refuse_by_name_and_write_nothing() -> None:
    arm, arena = jaco_arm.JacoArm(), Arena()
    arena.attach(arm)
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    before = physics.get_state()
    start = TcpInitializer(None, arm, [0.4, 0.0, 0.5])
    for refused, words in (
        (lambda: command_joint_positions(physics, None, np.zeros(6)), "arm must be"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: command_joint_positions(physics, arm, np.zeros(6), gain="fast"), "gain must be"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: command_site_velocity(physics, None, arm.wrist_site, np.zeros(6)), "arm must be"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: command_site_velocity(physics, arm, arm.wrist_site, np.full(6, 1e308)), "twist must not"),
        (lambda: start(physics, None), "random_state must be"),  # type: ignore[arg-type]  # wrong on purpose
        (lambda: TcpInitializer(None, arm, [0.4, 0.0, 0.5], max_ik_attempts=True), "max_ik_attempts"),
        (lambda: Primitive(["box"]), "unknown geom_type"),
        (lambda: Primitive("sphere", size=0.1), "size must have shape"),
        (lambda: Primitive("box", size=None), "size must"),
        (lambda: Primitive("box", size="big"), "size must"),
        (lambda: Primitive(mass=0.0), "mass must"),
        (lambda: Primitive(density=-1.0), "density must"),
        (lambda: Primitive(colour="red"), "attributes .*colour"),
        (lambda: Primitive(mass=np.inf), "mass must"),
        (lambda: Primitive(rgba="red"), "rgba must"),
    ):
        with pytest.raises(JacokinError, match=words):
            refused()
    assert physics.get_state().tobytes() == before.tobytes()


def test_dm_control_is_never_imported() -> None:
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import | ast.ImportFrom):
                modules = [alias.name for alias in node.names] if isinstance(node, ast.Import) else [node.module or ""]
                assert not any(module.startswith("dm_control") for module in modules), path


@pytest.mark.parametrize("page", ["mujoco_bridge.md"])
def test_the_page_runs(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All Python blocks of the page, one after the other."""
    monkeypatch.chdir(tmp_path)
    text = (Path(__file__).parents[2] / "docs" / page).read_text(encoding="utf-8")
    blocks = [block.split("```", 1)[0] for block in text.split("```python\n")[1:]]
    assert blocks
    namespace: dict[str, object] = {"__name__": page}
    for block in blocks:
        exec(compile(block, page, "exec"), namespace)
