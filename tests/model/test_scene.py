"""Scenes: distances to known shapes, files, MuJoCo models, and what a solver does with them."""

from __future__ import annotations

import copy
import json
import pickle
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import IKSolver, Robot, Status
from jacokin.errors import InvalidInputError, ModelError, UnknownNameError
from jacokin.ik import Box, Capsule, Cylinder, Floor, Scene, Sphere
from jacokin.model import Obstacle, PointCloud, SelfContact

TABLE = Box("table", [0.6, 0.6, 0.05], [0.5, -0.5, 0.1])


def test_the_distance_to_a_ball_is_measured_from_its_surface(robot: Robot) -> None:
    """Two balls around one centre: their distances differ by the difference of their radii."""
    centre = [0.9, 0.2, 0.9]
    small, large = (robot.clearance(robot.home, Scene([Sphere("ball", r, centre)])) for r in (0.01, 0.11))
    assert isinstance(small, float)
    assert isinstance(large, float)
    assert small > large > 0.0
    assert small - large == pytest.approx(0.1, abs=1e-6)


def test_the_pose_of_an_obstacle_is_a_copy(robot: Robot) -> None:
    cup = Box("cup", [0.06, 0.06, 0.12], [0.45, 0.2, 0.06])
    before, above = robot.clearance(robot.home, Scene([cup])), cup.pose
    assert isinstance(above, pin.SE3)
    above.translation[2] += 0.3
    assert robot.clearance(robot.home, Scene([cup])) == before
    assert isinstance(cup.pose, pin.SE3)
    np.testing.assert_array_equal(cup.pose.translation, [0.45, 0.2, 0.06])


def test_a_floor_is_as_far_as_the_lowest_shape_is_high(robot: Robot, rng: np.random.Generator) -> None:
    rows = robot.sample(rng, 20)
    low, high = (robot.clearance(rows, Scene([Floor(height)])) for height in (-2.0, -1.5))
    assert isinstance(low, np.ndarray)
    assert isinstance(high, np.ndarray)
    assert low.shape == (20,)
    np.testing.assert_allclose(low - high, 0.5, atol=1e-9)


def test_contact_and_distance_agree(robot: Robot, rng: np.random.Generator) -> None:
    """Contact is found by MuJoCo's collision pipeline, distance pair by pair."""
    scene = Scene([TABLE, Floor(-0.1), Capsule("post", 0.05, 0.6, [-0.4, 0.2, 0.3])])
    rows = robot.sample(rng, 150)
    distance = robot.clearance(rows, scene, self_collision=True)
    for clearance in (0.0, 0.03):
        solver = IKSolver(robot, collision="report", scene=scene, clearance=clearance)
        for q, far in zip(rows, np.atleast_1d(distance), strict=True):
            result = solver.solve(robot.forward_kinematics(q), seed=q)
            np.testing.assert_allclose(result.q, q, atol=1e-6)
            if abs(far - clearance) > 1e-5:
                assert bool(result.touching) == (far <= clearance)
    assert 10 < int((np.atleast_1d(distance) < 0.0).sum()) < 140


def test_a_solver_goes_around_what_it_can(robot: Robot, rng: np.random.Generator) -> None:
    scene = Scene([TABLE, Floor(-0.3)])
    solver = IKSolver(robot, collision="reject", scene=scene)
    own = SelfContact(robot)
    other, refused = 0, 0
    for q in robot.sample(rng, 600):
        if own.touching(q) or float(robot.clearance(q, scene)) > 0.0:
            continue
        result = solver.solve(robot.forward_kinematics(q), seed=q)
        if result.success:
            assert float(robot.clearance(result.q, scene)) > 0.0
            other += 1
        else:
            assert result.status is Status.IN_COLLISION
            assert any({"table", "floor"} & set(pair) for pair in result.touching)
            refused += 1
    assert other > 5
    assert refused > 5


def test_fingers_can_stand_at_another_angle(robot: Robot, rng: np.random.Generator) -> None:
    closed = jacokin.load_robot(finger_angle=1.2)
    rows = robot.sample(rng, 30)
    open_scene, closed_scene = Scene([TABLE]), Scene([TABLE], finger_angle=1.2)
    as_loaded = robot.clearance(rows, closed_scene)
    np.testing.assert_allclose(as_loaded, closed.clearance(rows, open_scene), atol=1e-12)
    assert np.abs(as_loaded - robot.clearance(rows, open_scene)).max() > 0.01
    with pytest.raises(InvalidInputError, match=r"finger_angle = 7.0: the fingers move from .* rad$"):
        robot.clearance(robot.home, Scene([TABLE], finger_angle=7.0))


FILE = """
finger_angle: 0.8
obstacles:
  - {shape: box, name: table, size: [0.6, 0.6, 0.05], position: [0.5, -0.5, 0.1], rpy: [0, 0, 0.3]}
  - {shape: sphere, name: ball, radius: 0.1, position: [0.1, 0.2, 0.3]}
  - {shape: capsule, name: post, radius: 0.05, length: 0.6, position: [-0.4, 0.2, 0.3]}
  - {shape: cylinder, name: can, radius: 0.03, length: 0.1, position: [0.4, 0.2, 0.3], quat_wxyz: [0, 1, 0, 0]}
  - {shape: floor, height: -0.1}
"""


def test_a_file_means_what_it_says(tmp_path: Path, robot: Robot, rng: np.random.Generator) -> None:
    import yaml

    (tmp_path / "scene.yaml").write_text(FILE)
    (tmp_path / "scene.json").write_text(json.dumps(yaml.safe_load(FILE)))
    here = Scene(
        [
            Box("table", [0.6, 0.6, 0.05], jacokin.pose([0.5, -0.5, 0.1], rpy=[0.0, 0.0, 0.3])),
            Sphere("ball", 0.1, [0.1, 0.2, 0.3]),
            Capsule("post", 0.05, 0.6, [-0.4, 0.2, 0.3]),
            Cylinder("can", 0.03, 0.1, jacokin.pose([0.4, 0.2, 0.3], quat_wxyz=[0.0, 1.0, 0.0, 0.0])),
            Floor(-0.1),
        ],
        finger_angle=0.8,
    )
    rows = robot.sample(rng, 20)
    for name in ("scene.yaml", "scene.json"):
        read = Scene.load(tmp_path / name)
        assert read.names == ("table", "ball", "post", "can", "floor")
        assert read.finger_angle == 0.8
        np.testing.assert_array_equal(robot.clearance(rows, read), robot.clearance(rows, here))
    (tmp_path / "list.yaml").write_text("- {shape: floor, name: ground}\n")
    assert Scene.load(tmp_path / "list.yaml").names == ("ground",)
    (tmp_path / "merged.yaml").write_text("- &first {shape: floor, name: ground}\n- {<<: *first, name: ceiling}\n")
    assert Scene.load(tmp_path / "merged.yaml").names == ("ground", "ceiling")


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("- {shape: cone}", UnknownNameError, r"shape in .*, obstacle 0: 'cone'.* Valid: box, sphere"),
        ("- {size: 3}", InvalidInputError, r"obstacle 0: needs the key 'shape', one of box, sphere"),
        ("- {type: box, size: 3}", UnknownNameError, r"key in .*, obstacle 0: 'type'. Valid: shape, name, size"),
        ("- {shape: }", UnknownNameError, r"shape in .*, obstacle 0: None. Valid: box"),
        ("- {shape: sphere, radius: 1}", InvalidInputError, r"sphere needs position"),
        ("- {shape: sphere, radius: -1, position: [0, 0, 0]}", InvalidInputError, r"radius must be a positive"),
        ("- {shape: sphere, radius: .nan, position: [0, 0, 0]}", InvalidInputError, r"radius must be a positive"),
        ("- {shape: box, size: [1, 2], position: [0, 0, 0]}", InvalidInputError, r"obstacle 0: .*size must"),
        ("- {shape: box, size: 1, position: oben}", InvalidInputError, r"obstacle 0"),
        ("- {shape: floor, hight: 1}", UnknownNameError, r"key in .*: 'hight'. Did you mean 'height'"),
        ("- {shape: floor, name: [1]}", InvalidInputError, r"name must be a word"),
        ("- [1, 2]", InvalidInputError, r"must be a mapping"),
        ("shapes: []", UnknownNameError, r"key in .*: 'shapes'. Valid: obstacles, finger_angle"),
        ("obstacles: 3", InvalidInputError, r"must be a list"),
        ("finger_angle: open", InvalidInputError, r"finger_angle must be a finite number"),
        ("just words", InvalidInputError, r"must be a list"),
        ("- {shape: floor", InvalidInputError, r"not a YAML file"),
        ("- {shape: floor}\n- {shape: floor, name: floor}", InvalidInputError, r"'floor' is used by two"),
        ("- !!python/object/apply:os.getcwd []", InvalidInputError, r"not a YAML file"),
        ("- {shape: floor, height: 0, height: 1}", InvalidInputError, r"scene.yaml: the key 'height' is given twice"),
        (
            "- {shape: robot, robot: a.urdf, q: [0], position: [0, 0, 0]}",
            ModelError,
            "obstacle 0: .*a.urdf: no such file",
        ),
        ("- {shape: floor, attached_to: hand}", UnknownNameError, r"'attached_to'. Valid: shape, name, height"),
        (
            "- {shape: sphere, radius: 1, position: [0, 0, 0], attached_to: 3}",
            InvalidInputError,
            r"0: attached_to must",
        ),
        ("obstacles: []\nobstacles: []", InvalidInputError, r"the key 'obstacles' is given twice"),
    ],
)
def test_wrong_files_are_refused_by_name(tmp_path: Path, text: str, error: type[Exception], words: str) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text(text)
    with pytest.raises(error, match=words):
        Scene.load(file)


def test_files_that_are_not_scenes(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="cannot be read"):
        Scene.load(tmp_path / "none.yaml")
    with pytest.raises(InvalidInputError, match=r"must end in .yaml or .yml or .json"):
        Scene.load(tmp_path / "scene.txt")
    (tmp_path / "twice.json").write_text('[{"shape": "floor", "height": 0, "height": 1}]')
    with pytest.raises(InvalidInputError, match=r"twice.json: the key 'height' is given twice"):
        Scene.load(tmp_path / "twice.json")
    (tmp_path / "broken.json").write_text("{")
    with pytest.raises(InvalidInputError, match="not a JSON file"):
        Scene.load(tmp_path / "broken.json")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InvalidInputError, match="not a text file"):
        Scene.load(tmp_path / "binary.yaml")
    with pytest.raises(InvalidInputError, match="path must be a file name"):
        Scene.load(3)  # type: ignore[arg-type]  # what is tested


WORLD = """
<mujoco>
  <worldbody>
    <geom name="ground" type="plane" size="1 1 0.1" pos="0 0 -0.2"/>
    <geom name="paint" type="box" size="1 1 1" contype="0" conaffinity="0"/>
    <body name="stand" pos="0.5 -0.3 0.1" euler="0 0 30">
      <geom name="top" type="box" size="0.2 0.3 0.02"/>
      <geom type="ellipsoid" size="0.1 0.05 0.02" pos="0 0 0.4"/>
      <site name="mount" pos="0 0 0.02"/>
    </body>
    <body name="mast" pos="-0.5 0 0.3"><geom name="rod" type="cylinder" size="0.03 0.2" euler="40 0 0"/></body>
    <body name="cup" pos="0.5 0 1"><freejoint/><geom name="cup" size="0.05"/></body>
    <body name="base" pos="1 1 0"><geom name="foot" type="capsule" size="0.1 0.1"/>
      <body name="arm"><joint name="hinge" axis="0 0 1"/><geom name="bar" size="0.2"/></body></body>
  </worldbody>
</mujoco>
"""


def test_a_mujoco_model_gives_its_static_geoms() -> None:
    model = mujoco.MjModel.from_xml_string(WORLD)
    scene = Scene.from_mujoco(model)
    assert scene.names == ("ground", "top", "stand#3", "rod")
    from_mount = Scene.from_mujoco(model, base="mount", exclude=["ground", "mast"])
    assert from_mount.names == ("top", "stand#3")
    top = from_mount.obstacles[0]
    assert isinstance(top, Box)
    assert isinstance(top.pose, pin.SE3)
    np.testing.assert_allclose(top.pose.translation, [0.0, 0.0, -0.02], atol=1e-12)
    np.testing.assert_allclose(top.pose.rotation, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.asarray(top.size), [0.4, 0.6, 0.04])


def test_distances_are_those_of_the_model_it_came_from(robot: Robot, rng: np.random.Generator) -> None:
    """The other way: geoms of the same numbers, put together by hand."""
    model = mujoco.MjModel.from_xml_string(WORLD)
    place = pin.SE3(pin.utils.rotate("z", 0.4), np.array([0.1, 0.2, -0.1]))
    moved = Scene.from_mujoco(model, base=place, exclude=["stand"])
    turned = pin.utils.rotate("x", np.radians(40.0))
    by_hand = Scene(
        [
            Floor(-0.1, "ground"),
            Cylinder("rod", 0.03, 0.4, place.inverse() * pin.SE3(turned, np.array([-0.5, 0.0, 0.3]))),
        ]
    )
    rows = robot.sample(rng, 30)
    np.testing.assert_allclose(robot.clearance(rows, moved), robot.clearance(rows, by_hand), atol=1e-9)


def test_models_that_do_not_fit_are_refused() -> None:
    model = mujoco.MjModel.from_xml_string(WORLD)
    with pytest.raises(InvalidInputError, match="compiled mujoco.MjModel"):
        Scene.from_mujoco("scene.xml")
    with pytest.raises(UnknownNameError, match="body or site 'mout'. Did you mean 'mount'"):
        Scene.from_mujoco(model, base="mout")
    with pytest.raises(UnknownNameError, match="geom or body 'tops'"):
        Scene.from_mujoco(model, exclude=["tops"])
    with pytest.raises(InvalidInputError, match="'ground' is not horizontal"):
        Scene.from_mujoco(model, base=pin.SE3(pin.utils.rotate("x", 0.1), np.zeros(3)))


@pytest.mark.parametrize("name", ["half\ud800", "nul\0"], ids=["lone surrogate", "nul"])
def test_names_that_no_model_can_hold_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InvalidInputError, match="the name of an obstacle must be a text that UTF-8 can write"):
        Sphere(name, 0.1, [1.0, 1.0, 1.0])
    path = tmp_path / "scene.json"
    path.write_text(json.dumps([{"shape": "sphere", "name": name, "radius": 0.1, "position": [1, 1, 1]}]))
    with pytest.raises(InvalidInputError, match="obstacle 0: the name of an obstacle"):
        Scene.load(path)


def test_wrong_arguments(robot: Robot, tmp_path: Path) -> None:
    scene = Scene([TABLE])
    for collision in ("report", "reject"):
        with pytest.raises(InvalidInputError, match="scene must be a Scene"):
            IKSolver(robot, scene=[TABLE], collision=collision)  # type: ignore[arg-type]  # what is tested
    with pytest.raises(InvalidInputError, match="scene has no effect with collision='ignore'"):
        IKSolver(robot, scene=scene, collision="ignore")
    with pytest.raises(InvalidInputError, match="clearance has no effect"):
        IKSolver(robot, clearance=0.01, collision="ignore")
    with pytest.raises(InvalidInputError, match="clearance must be a finite number >= 0"):
        IKSolver(robot, scene=scene, collision="reject", clearance=-1.0)
    with pytest.raises(InvalidInputError, match="'hand_palm' is used by a shape of the arm"):
        robot.clearance(robot.home, Scene([Sphere("hand_palm", 0.1, [1.0, 1.0, 1.0])]))
    with pytest.raises(InvalidInputError, match="scene must be a Scene"):
        robot.clearance(robot.home, [TABLE])  # type: ignore[arg-type]  # what is tested
    with pytest.raises(InvalidInputError, match="q must have shape"):
        robot.clearance([1.0, 2.0], scene)
    with pytest.raises(InvalidInputError, match="row 1 is not"):
        robot.clearance([robot.home, robot.home * np.nan], scene)
    with pytest.raises(AttributeError, match="a Scene does not change"):
        scene.finger_angle = 1.0  # type: ignore[misc]  # what is tested
    bare = tmp_path / "bare.xml"
    bare.write_text(
        '<mujoco><worldbody><body name="a"><joint name="j" axis="0 0 1"/><inertial pos="0 0 0" mass="1" '
        'diaginertia="1 1 1"/><body name="b"><joint name="k" axis="0 1 0"/><inertial pos="0 0 0" mass="1" '
        'diaginertia="1 1 1"/></body></body></worldbody></mujoco>'
    )
    with pytest.raises(ModelError, match="no collision shapes"):
        jacokin.load_robot(bare).clearance([0.0, 0.0], scene)


def test_scenes_and_their_solvers_can_be_copied(robot: Robot) -> None:
    scene = Scene([TABLE, Floor(-0.1)], finger_angle=0.5)
    expected = robot.clearance(robot.home, scene)
    for again in (pickle.loads(pickle.dumps(scene)), copy.deepcopy(scene)):
        assert again.names == scene.names
        assert robot.clearance(robot.home, again) == expected
    solver = pickle.loads(pickle.dumps(IKSolver(robot, scene=scene, collision="reject", clearance=0.01)))
    assert solver.verifier.options.scene.names == scene.names
    assert solver.verifier.options.clearance == 0.01
    assert repr(scene) == "Scene(table, floor)"
    assert len(scene) == len(list(scene)) == 2
    assert robot.clearance(robot.home, Scene()) == np.inf


def test_a_scene_changes_into_others(robot: Robot, rng: np.random.Generator) -> None:
    post, ball = Capsule("post", 0.05, 0.6, [-0.4, 0.2, 0.3]), Sphere("ball", 0.1, [0.4, 0.4, 0.4])
    scene = Scene([TABLE, post, Floor(-0.3)], allow=[("post", "hand")], finger_angle=0.5)
    there = jacokin.pose([0.3, 0.3, 0.6], rpy=[0.3, 0.2, 0.1])
    moved = Box("table", np.asarray(TABLE.size), [0.5, 0.5, 0.1]), Capsule("post", 0.05, 0.6, there), Floor(-0.3)
    cases: list[tuple[Scene, tuple[Obstacle, ...]]] = [
        (scene.adding(ball), (TABLE, post, Floor(-0.3), ball)),
        (scene.removing("table", "floor"), (post,)),
        (scene.moving({"post": there, "table": [0.5, 0.5, 0.1]}), moved),
    ]
    for changed, written in cases:
        expected = Scene(written, allow=scene.allow, finger_angle=0.5)
        assert changed.names == expected.names
        assert (changed.allow, changed.finger_angle) == (scene.allow, 0.5)
        rows = robot.sample(rng, 50)
        np.testing.assert_array_equal(robot.clearance(rows, changed), robot.clearance(rows, expected))
    assert scene.names == ("table", "post", "floor")
    assert scene.removing("post").allow == ()
    assert np.isfinite(robot.clearance(robot.home, scene.removing("post")))


def test_a_scene_does_not_change_into_nonsense() -> None:
    scene = Scene([TABLE, Floor(-0.3)]).attach(Sphere("ball", 0.1, [0.0, 0.0, 0.0]))
    for twice in (TABLE, Sphere("ball", 0.2, [1.0, 0.0, 0.0])):
        with pytest.raises(InvalidInputError, match=f"'{twice.name}' is used by two shapes"):
            scene.adding(twice)
    with pytest.raises(UnknownNameError, match=r"tabel.*table"):
        scene.removing("floor", "tabel")
    with pytest.raises(InvalidInputError, match="coming must be a dict of names and shapes, got 3"):
        scene.changed([], 3)  # type: ignore[arg-type]  # a user's mistake
    with pytest.raises(InvalidInputError, match="obstacles must be shapes with a name"):
        scene.changed([], {"cup": 3})  # type: ignore[dict-item]  # a user's mistake
    with pytest.raises(UnknownNameError, match=r"tabel.*table"):
        scene.moving({"tabel": [0.0, 0.0, 0.0]})
    with pytest.raises(InvalidInputError, match="where a pose is given"):
        scene.moving({"floor": [0.0, 0.0, 0.0]})
    with pytest.raises(InvalidInputError, match="finite"):
        scene.moving({"table": [0.0, np.nan, 0.0]})
    with pytest.raises(InvalidInputError, match="a dict of names and poses"):
        scene.moving("table")  # type: ignore[arg-type]


def test_what_is_allowed_with_a_shape_goes_with_it(robot: Robot) -> None:
    scene = Scene([TABLE], allow=[("ball", "hand"), ("table", "hand")]).attach(Sphere("ball", 0.1, [0.0, 0.0, 0.3]))
    assert scene.detach("ball").allow == (("table", "hand"),)
    assert scene.detach("ball", pose=[1.0, 0.0, 0.0]).allow == scene.allow
    assert scene.changed(["table"], {}).allow == (("ball", "hand"),)
    assert np.isfinite(robot.clearance(robot.home, scene.changed(["table"], {}).adding(Floor(-1.0))))


def test_scenes_with_the_same_fingerprint_are_the_same(robot: Robot, tmp_path: Path) -> None:
    """However a scene was made, and in which process: maps and files that go on ask whether it is the same."""
    file, cloud = tmp_path / "scene.json", PointCloud("cloud", np.eye(3))
    box = {"shape": "box", "name": "table", "size": [0.6, 0.6, 0.05], "position": [0.5, -0.5, 0.1]}
    file.write_text(json.dumps({"obstacles": [box, {"shape": "floor"}]}))
    scene = Scene([TABLE, Floor()])
    again = (Scene.load(file), pickle.loads(pickle.dumps(scene)), Scene([TABLE]).adding(Floor()))
    assert {each.surroundings.fingerprint for each in (scene, *again)} == {scene.surroundings.fingerprint}
    held = scene.attach(Sphere("ball", 0.1, [0.0, 0.0, 0.1]))
    others = [
        Scene([Floor(), TABLE]),
        Scene([TABLE, Floor(1e-9)]),
        scene.moving({"table": [0.5, -0.5, 0.2]}),
        scene.allowing(("table", "hand")),
        scene.with_fingers(0.3),
        held,
        scene.attach(Sphere("ball", 0.1, [0.0, 0.0, 0.1]), "link_4"),
        scene.adding(cloud),
        scene.adding(PointCloud("cloud", (1.0 + 1e-9) * np.eye(3))),
        scene.adding_robot(robot, robot.home, name="other", base=[1.0, 0.0, 0.0]),
        scene.adding_robot(robot, robot.home + 0.1, name="other", base=[1.0, 0.0, 0.0]),
    ]
    found = [each.surroundings.fingerprint for each in (scene, *others)]
    assert len(set(found)) == len(found)


def test_a_saved_scene_is_read_as_it_was(robot: Robot, tmp_path: Path, rng: np.random.Generator) -> None:
    """To the last bit, whatever the rotations: the fingerprint has them."""
    turned = [pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3)) for _ in range(4)]
    scene = Scene(
        [
            Box("table", rng.uniform(0.1, 1.0, 3), turned[0]),
            Capsule("post", 0.1 / 3.0, 0.6, turned[1]),
            Cylinder("can", 0.03, 0.1, jacokin.pose([0.4, 0.2, 0.3], down=True)),
            Sphere("ball", 0.1, rng.normal(size=3)),
            PointCloud("seen", rng.normal(size=(20, 3)), 0.01, turned[2]),
            PointCloud("behind the arm", rng.normal(size=(5, 3))),
            Floor(-0.1),
        ],
        finger_angle=0.8,
        allow=[("hand", "cup"), ("ball", "link_1")],
    )
    scene = scene.attach(Box("cup", [0.05, 0.05, 0.1], turned[3]), "link_6")
    scene = scene.adding_robot(robot, robot.home + 0.1, name="other", base=turned[1], finger_angle=0.5)
    file = tmp_path / "scene.json"
    scene.save(file)
    read = Scene.load(file)
    assert read.surroundings.fingerprint == scene.surroundings.fingerprint
    assert read.allow == scene.allow
    assert [each.name for each in read.robots] == ["other"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["scene.5.npz", "scene.json", "scene_seen.npz"]
    (tmp_path / "elsewhere").mkdir()
    for path in list(tmp_path.glob("scene*")):
        path.rename(tmp_path / "elsewhere" / path.name)
    moved = Scene.load(tmp_path / "elsewhere" / "scene.json")
    assert moved.surroundings.fingerprint == scene.surroundings.fingerprint


def test_scenes_that_no_file_holds_are_refused(robot: Robot, tmp_path: Path) -> None:
    class Own:
        name = "own"

        def add_to(self, body: mujoco.MjsBody) -> None:
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1, 0, 0])

    with pytest.raises(InvalidInputError, match="'own' is a Own, which no file of a scene holds"):
        Scene([Own()]).save(tmp_path / "own.json")
    with pytest.raises(InvalidInputError, match="a scene is saved as .json, got"):
        Scene().save(tmp_path / "scene.yaml")
    limited = jacokin.load_robot(limits={"joint_1": (0.0, 1.0)})
    with pytest.raises(InvalidInputError, match="'other' was loaded with options, which no file"):
        Scene().adding_robot(limited, limited.home, name="other", base=[1.0, 0, 0]).save(tmp_path / "other.json")
    parts = Scene().adding_robot(robot, robot.home, name="other", base=[1.0, 0, 0]).obstacles
    with pytest.raises(InvalidInputError, match="of the robot 'other' some shapes are not in the scene"):
        Scene(parts[:2]).save(tmp_path / "other.json")
    assert not list(tmp_path.iterdir())
    with pytest.raises(InvalidInputError, match="scene.json: cannot be written: No such file or directory"):
        Scene().save(tmp_path / "missing" / "scene.json")
    (tmp_path / "folder.json").mkdir()
    with pytest.raises(InvalidInputError, match="folder.json: cannot be written: it is a folder"):
        Scene().save(tmp_path / "folder.json")


def test_names_of_links_and_obstacles_in_allowed_pairs_are_told_apart(robot: Robot) -> None:
    """The obstacle was meant silently, so that contact with the link still counted."""
    for name, what in (("hand", "a link of the arm"), ("robot", "all of the arm")):
        scene = Scene([Box(name, [0.1, 0.1, 0.1], [1.0, 0.0, 0.0]), TABLE], allow=[(name, "table")])
        with pytest.raises(InvalidInputError, match=f"allow: '{name}' is {what} and an obstacle"):
            robot.clearance(robot.home, scene)
        assert robot.clearance(robot.home, scene.removing(name)) > 0.0  # a name without contact that is allowed
