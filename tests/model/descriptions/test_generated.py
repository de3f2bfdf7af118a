"""The files in urdf/: regenerated from the table, named as promised, the same robot in both formats."""

from __future__ import annotations

import importlib
import math
import shutil
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from jacokin.model.descriptions import bundled

FOLDER = Path(__file__).resolve().parents[3] / "urdf"
JACOS = ("j2n6s300", "j2n6s200", "j2s6s200", "j2s6s300", "m1n6s200", "m1n6s300", "j2s7s300", "j2s7s200")
GEN3S = ("gen3", "gen3_6dof", "gen3_lite")
NAMES = (*JACOS, *GEN3S)
ARM_LINKS = ["link_base", "link_1", "link_2", "link_3", "link_4", "link_5", "link_6"]
JOINTS = dict.fromkeys(NAMES, 6) | dict.fromkeys(("j2s7s300", "j2s7s200", "gen3"), 7)
FINGERS = {name: 3 if name.endswith("300") else 2 for name in JACOS} | {"gen3": 0, "gen3_6dof": 0, "gen3_lite": 2}
# Both engines compute the same chain in double precision; what is left is rounding.
POSE_TOLERANCE = 1e-12
DYNAMICS_TOLERANCE = 1e-11
NOT_NUMBERS = {"fingers", "sites", "exclude_arm", "parts"}  # lists in the table, of names or shapes, or empty


@pytest.fixture
def generator(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(FOLDER.parent))
    return importlib.import_module("urdf.generate")


def read(name: str) -> dict[str, Any]:
    with (FOLDER / name).open("rb") as file:
        return tomllib.load(file)


def fingers(name: str) -> list[str]:
    return [f"finger_{i + 1}" for i in range(FINGERS[name])]


def frames(name: str) -> list[str]:
    grip = ["gripsite"] if name in JACOS else []
    pinch = ["pinchsite"] if name.endswith("300") else []
    return ["end_effector", "wristsite", *grip, *pinch]


def mjcf(name: str) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(FOLDER / f"{name}.xml"))


def urdf(name: str) -> pin.Model:
    return pin.buildModelFromUrdf(str(FOLDER / f"{name}.urdf"))


def pin_q(model: pin.Model, mj: mujoco.MjModel, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angles in MuJoCo's joint order as Pinocchio's configuration, continuous joints as cosine and sine."""
    out = np.zeros(model.nq)
    for i, value in enumerate(q):
        joint = model.joints[model.getJointId(mj.joint(i).name)]
        out[joint.idx_q : joint.idx_q + joint.nq] = (math.cos(value), math.sin(value))[: joint.nq]
        if joint.nq == 1:
            out[joint.idx_q] = value
    return out


# --- the generator and the table -----------------------------------------------------------------------------


def test_files_are_what_the_table_says(generator: ModuleType) -> None:
    texts = generator.files()
    assert set(texts) == {p.name for p in FOLDER.iterdir() if p.suffix in {".xml", ".urdf", ".json"}}
    expected = {f"{name}.{suffix}" for name in NAMES for suffix in ("urdf", "xml")}
    parts = {bundled.part_file(name, part).name for name in JACOS for part in ("arm", "hand")}
    assert {"jaco_arm.xml", "jaco_hand.xml"} < parts
    assert set(texts) == expected | parts | {bundled.WRITTEN}
    for name, text in texts.items():
        assert (FOLDER / name).read_bytes() == text.encode(), f"{name} is stale: run python urdf/generate.py"


def test_script_writes_the_files(tmp_path: Path) -> None:
    copy = tmp_path / "urdf"
    copy.mkdir()
    for source in [*FOLDER.glob("*.py"), *FOLDER.glob("*.toml")]:
        shutil.copy(source, copy)
    subprocess.run([sys.executable, copy / "generate.py"], check=True, capture_output=True, cwd=tmp_path)
    assert (copy / "j2n6s300.urdf").read_bytes() == (FOLDER / "j2n6s300.urdf").read_bytes()


def leaves(rows: Mapping[str, Any], path: str, source: str | None) -> Iterator[tuple[str, str, str | None]]:
    """Path, field and source of every number in a table."""
    source = rows.get("source", source)
    for key, value in rows.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{path}.{key}", source)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            for row in value:
                yield from leaves(row, f"{path}.{key}", source)
        elif key not in NOT_NUMBERS and not isinstance(value, (bool, str)):
            yield path, key, source


def test_every_number_has_a_unit_and_a_source() -> None:
    table = bundled.read_tables(FOLDER, *bundled.TABLES)
    sources, units = table.pop("sources"), table.pop("units")
    numbers = [*leaves(table, "", None), *leaves(read("shapes.toml"), "shapes", None)]
    assert len(numbers) > 500
    assert not [path + "." + key for path, key, _ in numbers if key not in units]
    assert not [path + "." + key for path, key, source in numbers if source not in sources]


def test_the_package_reads_what_the_tables_say() -> None:
    assert bundled.robot_table() == bundled.read_tables(FOLDER, *bundled.TABLES)


def test_no_section_is_in_both_tables() -> None:
    tables = [read(name) for name in bundled.TABLES]
    for group in set(tables[0]) & set(tables[1]):
        assert not set(tables[0][group]) & set(tables[1][group]), group


def test_angles_are_exact(generator: ModuleType) -> None:
    description = sys.modules[generator.describe.__module__]
    assert description.parse_angle("-pi/2") == -math.pi / 2
    assert description.parse_angle("pi/3") == math.pi / 3
    assert description.parse_angle(0.5) == 0.5
    with pytest.raises(ValueError, match=r"'2pi' is not an angle.*'pi/3'"):
        description.parse_angle("2pi")


# --- names and contents --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_names_in_both_formats(name: str) -> None:
    tips = [finger.replace("finger", "finger_tip") for finger in fingers(name)]
    arm = [*ARM_LINKS, "link_7"][: JOINTS[name] + 1]
    hand = ["hand"] if FINGERS[name] else []
    bodies = [*arm, *hand, *(f"link_{x}" for pair in zip(fingers(name), tips, strict=True) for x in pair)]
    joints = [f"joint_{i}" for i in range(1, JOINTS[name] + 1)] + fingers(name)

    model = mjcf(name)
    assert [model.body(i).name for i in range(1, model.nbody)] == bodies
    assert [model.joint(i).name for i in range(model.njnt)] == joints
    assert [model.site(i).name for i in range(model.nsite)] == frames(name)

    robot = ET.parse(FOLDER / f"{name}.urdf").getroot()
    links = [link.get("name") for link in robot.findall("link")]
    assert links == bodies + frames(name)
    moving = [j.get("name") for j in robot.findall("joint") if j.get("type") != "fixed"]
    assert moving == joints
    everything = links + [j.get("name") for j in robot.findall("joint")]
    assert len(everything) == len(set(everything)), "Pinocchio looks links and joints up as frames alike"


@pytest.mark.parametrize("file", sorted(path.name for path in FOLDER.glob("*.xml")))
def test_mjcf_holds_the_robot_only(file: str) -> None:
    root = ET.parse(FOLDER / file).getroot()
    assert {child.tag for child in root if isinstance(child.tag, str)} == {
        "compiler", "default", "asset", "worldbody", "contact",
    }  # fmt: skip


def test_arm_file_ends_at_the_wrist_site() -> None:
    arm, hand = mjcf("jaco_arm"), mjcf("jaco_hand")
    assert [arm.site(i).name for i in range(arm.nsite)] == ["end_effector", "wristsite"]
    assert [arm.body(i).name for i in range(1, arm.nbody)] == ARM_LINKS
    assert [hand.site(i).name for i in range(hand.nsite)] == ["gripsite", "pinchsite"]
    assert hand.body(1).name == "hand"


@pytest.mark.parametrize("robot", JACOS)
def test_hand_attached_at_the_wrist_site_is_the_whole_robot(robot: str) -> None:
    arm = mujoco.MjSpec.from_file(str(bundled.part_file(robot, "arm")))
    hand = mujoco.MjSpec.from_file(str(bundled.part_file(robot, "hand")))
    arm.attach(hand, prefix="jaco_hand/", site=arm.site("wristsite"))
    attached, whole = arm.compile(), mjcf(robot)
    a, b = mujoco.MjData(attached), mujoco.MjData(whole)
    a.qpos[:] = b.qpos[:] = np.random.default_rng(1).uniform(-2, 2, whole.nq)
    mujoco.mj_forward(attached, a)
    mujoco.mj_forward(whole, b)
    for field in ("xpos", "xmat", "geom_xpos", "geom_xmat", "qfrc_bias"):
        np.testing.assert_allclose(getattr(a, field), getattr(b, field), atol=POSE_TOLERANCE, rtol=0)
    assert attached.nexclude == whole.nexclude == (7 if robot.endswith("300") else 4)
    np.testing.assert_allclose(attached.body_mass.sum(), whole.body_mass.sum(), rtol=1e-12)


# --- numbers -------------------------------------------------------------------------------------------------


def test_limits_are_the_published_degrees_to_the_last_bit() -> None:
    expected = {
        "j2n6s300": {"joint_2": (47, 313), "joint_3": (19, 341)},
        "j2n6s200": {"joint_2": (47, 313), "joint_3": (19, 341)},
        "j2s6s200": {"joint_2": (47, 313), "joint_3": (19, 341), "joint_5": (30, 330)},
        "j2s6s300": {"joint_2": (47, 313), "joint_3": (19, 341), "joint_5": (30, 330)},
        "m1n6s200": {"joint_2": (50, 310), "joint_3": (35, 325)},
        "m1n6s300": {"joint_2": (50, 310), "joint_3": (35, 325)},
        "j2s7s300": {"joint_2": (47, 313), "joint_4": (30, 330), "joint_6": (65, 295)},
        "j2s7s200": {"joint_2": (47, 313), "joint_4": (30, 330), "joint_6": (65, 295)},
    }
    for name, limits in expected.items():
        model, robot = mjcf(name), urdf(name)
        for i in range(model.njnt):
            joint = model.joint(i)
            if joint.name.startswith("finger"):
                bounds = (0.15, 1.35)
            elif joint.name in limits:
                low, high = limits[joint.name]
                bounds = (math.radians(low), math.radians(high))
            else:
                assert not model.jnt_limited[i]
                assert robot.joints[robot.getJointId(joint.name)].nq == 2
                continue
            index = robot.joints[robot.getJointId(joint.name)].idx_q
            assert tuple(model.jnt_range[i]) == bounds
            assert (robot.lowerPositionLimit[index], robot.upperPositionLimit[index]) == bounds


def test_speeds_and_efforts_of_the_urdf() -> None:
    robot = urdf("j2n6s300")
    speeds = [math.radians(x) for x in (36, 36, 36, 48, 48, 48)] + [1.0] * 3
    np.testing.assert_array_equal(robot.velocityLimit, speeds)
    np.testing.assert_array_equal(robot.effortLimit, [40, 80, 40, 20, 20, 20, 2, 2, 2])


def test_limits_of_the_gen3() -> None:
    """Kinova's kortex_description of 2024-03 [rad]."""
    expected = {
        "gen3": (None, 2.24, None, 2.57, None, 2.09, None),
        "gen3_6dof": (None, 2.24, 2.57, None, 2.09, None),
        "gen3_lite": (2.68, 2.61, 2.61, 2.6, 2.53, 2.6),
    }
    for name, limits in expected.items():
        model, robot = mjcf(name), urdf(name)
        for i, limit in enumerate(limits):
            joint = robot.joints[robot.getJointId(f"joint_{i + 1}")]
            assert joint.nq == (2 if limit is None else 1)
            assert model.jnt_limited[i] == (limit is not None)
            if limit is not None:
                assert tuple(model.jnt_range[i]) == (-limit, limit)
                at = joint.idx_q
                assert (robot.lowerPositionLimit[at], robot.upperPositionLimit[at]) == (-limit, limit)


def test_speeds_and_efforts_of_the_gen3() -> None:
    np.testing.assert_array_equal(urdf("gen3").velocityLimit, [1.3963] * 4 + [1.2218] * 3)
    np.testing.assert_array_equal(urdf("gen3").effortLimit, [39.0] * 4 + [9.0] * 3)
    np.testing.assert_array_equal(urdf("gen3_6dof").velocityLimit, [1.3963] * 3 + [1.2218] * 3)
    np.testing.assert_array_equal(urdf("gen3_lite").velocityLimit[:6], [1.6] * 5 + [3.2])
    np.testing.assert_array_equal(urdf("gen3_lite").effortLimit[:6], [10.0, 14.0, 10.0, 7.0, 7.0, 7.0])


def test_speeds_of_seven_joints() -> None:
    speeds = [math.radians(x) for x in (36, 36, 36, 36, 48, 48, 48)] + [1.0] * 3
    np.testing.assert_array_equal(urdf("j2s7s300").velocityLimit, speeds)


def test_the_seven_joint_arm_is_the_six_joint_arm_when_its_upper_arm_does_not_turn() -> None:
    """At q3 = 0 the two offsets of the seven-joint arm are the one of the six-joint arm with a spherical wrist."""
    six, seven = mjcf("j2s6s300"), mjcf("j2s7s300")
    a, b = mujoco.MjData(six), mujoco.MjData(seven)
    for q in np.random.default_rng(5).uniform(-math.pi, math.pi, (20, 6)):
        a.qpos[:6] = q
        b.qpos[:7] = (q[0], q[1], 0.0, q[2], q[3], q[4], q[5])
        mujoco.mj_kinematics(six, a)
        mujoco.mj_kinematics(seven, b)
        apart = np.linalg.norm(a.site("end_effector").xpos - b.site("end_effector").xpos)
        assert apart < 1e-12, apart


def test_total_mass() -> None:
    """4.31 kg is what the source adds up to, short of the datasheet's 4.4 + 0.727 kg."""
    assert mjcf("j2n6s300").body_mass.sum() == pytest.approx(4.3105157, abs=1e-6)


@pytest.mark.one_quick
@pytest.mark.parametrize("name", NAMES)
def test_both_formats_are_the_same_robot(name: str) -> None:
    model, robot = mjcf(name), urdf(name)
    data, pin_data = mujoco.MjData(model), robot.createData()
    rng = np.random.default_rng(2)
    for _ in range(20):
        data.qpos[:] = rng.uniform(-math.pi, math.pi, model.nq)
        mujoco.mj_forward(model, data)
        q = pin_q(robot, model, data.qpos)
        pin.framesForwardKinematics(robot, pin_data, q)
        poses = [(data.body(i).name, data.xpos[i], data.xmat[i]) for i in range(1, model.nbody)]
        poses += [(data.site(i).name, data.site_xpos[i], data.site_xmat[i]) for i in range(model.nsite)]
        for frame, position, rotation in poses:
            placement = pin_data.oMf[robot.getFrameId(frame, pin.FrameType.BODY)]
            np.testing.assert_allclose(placement.translation, position, atol=POSE_TOLERANCE, rtol=0)
            np.testing.assert_allclose(placement.rotation.ravel(), rotation, atol=POSE_TOLERANCE, rtol=0)
        inertia = np.zeros((model.nv, model.nv))
        for column in range(model.nv):
            mujoco.mj_mulM(model, data, inertia[column], np.eye(model.nv)[column])
        inertia -= np.diag(model.dof_armature)
        upper = np.triu(pin.crba(robot, pin_data, q))
        np.testing.assert_allclose(upper, np.triu(inertia), atol=DYNAMICS_TOLERANCE, rtol=0)
        gravity = pin.computeGeneralizedGravity(robot, pin_data, q)
        np.testing.assert_allclose(gravity, data.qfrc_bias, atol=DYNAMICS_TOLERANCE, rtol=0)


@pytest.mark.one_quick
@pytest.mark.parametrize("name", NAMES)
def test_the_same_primitives_in_both_formats(name: str) -> None:
    model, robot = mjcf(name), urdf(name)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    q = pin_q(robot, model, data.qpos)
    for kind in (pin.GeometryType.COLLISION, pin.GeometryType.VISUAL):
        shapes = pin.buildGeomFromUrdf(robot, str(FOLDER / f"{name}.urdf"), kind)
        shape_data = shapes.createData()
        pin.updateGeometryPlacements(robot, robot.createData(), shapes, shape_data, q)
        assert shapes.ngeoms == model.ngeom
        for g, shape in enumerate(shapes.geometryObjects):  # both files list the bodies in the same order
            assert robot.frames[shape.parentFrame].name == model.body(model.geom_bodyid[g]).name
            np.testing.assert_allclose(shape_size(shape.geometry), model.geom_size[g], atol=1e-15, rtol=0)
            pose = shape_data.oMg[g]
            np.testing.assert_allclose(pose.translation, data.geom_xpos[g], atol=POSE_TOLERANCE, rtol=0)
            np.testing.assert_allclose(pose.rotation.ravel(), data.geom_xmat[g], atol=POSE_TOLERANCE, rtol=0)


def shape_size(geometry: Any) -> list[float]:
    """The shape's dimensions in MuJoCo's convention [m]."""
    kind = type(geometry).__name__
    if kind == "Box":
        return list(geometry.halfSide)
    return [geometry.radius, geometry.halfLength if kind == "Cylinder" else 0.0, 0.0]


# --- published poses of the real arm -------------------------------------------------------------------------


def end_effector(q: NDArray[np.float64]) -> pin.SE3:
    model, robot = mjcf("j2n6s300"), urdf("j2n6s300")
    data = robot.createData()
    pin.framesForwardKinematics(robot, data, pin_q(robot, model, np.concatenate([q, [0.5] * 3])))
    return data.oMf[robot.getFrameId("end_effector", pin.FrameType.BODY)].copy()


def test_published_home_of_the_driver() -> None:
    """The document's joint angles, rounded to 0.1 degrees, land within their rounding of its pose."""
    published = pin.SE3(
        pin.rpy.rpyToMatrix(1.63771402836, 0, 0)
        @ pin.rpy.rpyToMatrix(0, 1.11316478252, 0)
        @ pin.rpy.rpyToMatrix(0, 0, 0.134094119072),
        np.array([0.212322831154, -0.257197618484, 0.509646713734]),
    )
    error = published.actInv(end_effector(np.radians([275.0, 167.4, 57.4, 241.0, 82.7, 75.5])))
    assert np.linalg.norm(error.translation) == pytest.approx(0.0038, abs=2e-4)
    assert np.linalg.norm(pin.log3(error.rotation)) == pytest.approx(0.011, abs=1e-3)


def test_published_home_of_the_motion_planner() -> None:
    pose = end_effector(np.array([4.8046852, 2.92482, 1.002, 4.2031852, 1.4458, 1.3233]))
    np.testing.assert_allclose(pose.translation, [0.212743, -0.256609, 0.506962], atol=1e-6)
