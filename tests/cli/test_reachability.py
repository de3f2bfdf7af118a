"""`jacokin map` and `jacokin place`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin import Robot, reachability
from jacokin.ik import Scene
from jacokin.model import quat_wxyz, urdf_folder
from jacokin.reachability import ReachabilityMap, load
from tests.cli.run import Run
from tests.robot_files import ur5_text


@pytest.mark.slow
def test_a_map_is_built_in_shards_asked_and_drawn(run: Run, tmp_path: Path) -> None:
    words = ["map", "build", str(tmp_path / "map"), "--spacing", "0.15", "--orientations", "2000", "--workers", "2"]
    assert "others are missing" in run(*words, "--shard", "1/2").out
    run("map", "query", tmp_path / "map", "--position", "0.3", "0.2", "0.4", code=2)
    assert "poses" in run(*words).out
    answer = run("map", "query", tmp_path / "map", "--position", "1.9", "0.2", "0.4", "--down", "--json")
    assert (answer.document["dexterity"], answer.document["covered"]) == (0.0, False)
    outside = run("map", "query", tmp_path / "map", "--position", "1.9", "0.2", "0.4").out
    assert "not known: outside the grid of the map" in outside
    assert (answer.document["reached"], answer.document["reached_by"]) == (False, "solver")
    pose = jacokin.pose(answer.document["nearest_position"], answer.document["nearest_quat_wxyz"])
    assert jacokin.solve_ik(pose).success
    run("map", "show", tmp_path / "map", "--output", tmp_path / "map.html")
    page = (tmp_path / "map.html").read_text(encoding="utf-8")
    assert '"obstacles":[]' in page
    scene = tmp_path / "scene.yaml"
    scene.write_text("- {shape: sphere, radius: 0.1, position: [0.5, 0, 0.2]}\n", encoding="utf-8")
    drawn = tmp_path / "obstacles.html"
    run("map", "show", tmp_path / "map", "--scene", scene, "--output", drawn)
    assert '"obstacles":[[[0.6' in drawn.read_text(encoding="utf-8")
    assert "obstacles not counted" in drawn.read_text(encoding="utf-8")
    assert "not counted" not in page


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("map", "build", "x", "--spacing", "1e-5"), "cells"),
        (("map", "build", "x", "--lower", "0", "0", "0"), "--lower goes with --upper"),
        (("map", "build", "x", "--shard", "3/2"), "--shard must be 'i/n'"),
        (("map", "build", "x", "--free-axis", "0 0 0"), "--free-axis must have a direction"),
        (("map", "build", "x", "--free-axis", "up"), "--free-axis"),
        (("map", "query", "nowhere", "--position", "0", "0", "0"), "unknown map 'nowhere'. Valid: j2n6s300"),
        (("map", "show", "j2n6s30"), "Did you mean 'j2n6s300'"),
        (("map", "fold"), "No such command 'fold'"),
    ],
)
def test_mistakes_are_sentences(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert message in run(*words, code=2).err
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_maps_with_a_free_axis_obstacles_and_seven_joints(run: Run, tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text("obstacles:\n- {shape: floor, height: 0.1}\n", encoding="utf-8")
    box = ("--lower", "0.1", "-0.3", "0.0", "--upper", "0.7", "0.3", "0.6", "--spacing", "0.2")
    folders = [str(tmp_path / name) for name in "abcd"]
    run("map", "build", folders[0], *box, "--down", "--free-axis", "x")
    scene = ("--scene", str(tmp_path / "scene.yaml"), "--orientations", "8")
    run("map", "build", folders[1], *box, *scene)
    own = ("--tool", "0", "0.1", "0", "--limit", "joint_2=1,5")
    run("map", "build", folders[2], *box, "--collision", "reject", "--orientations", "8", *own)
    run("map", "build", folders[3], *box, "--robot", "j2s7s300", "--orientations", "8")
    maps = [load(folder) for folder in folders]
    assert maps[0].orientations.axes is not None
    assert maps[1].recipe["scene"] is not None
    assert np.array(maps[2].recipe["tool"])[:3, 3].tolist() == [0.0, 0.1, 0.0]
    assert maps[2].recipe["robot"]["sha256"] != maps[1].recipe["robot"]["sha256"]
    assert [each.recipe["collision"] for each in maps] == ["prefer", "reject", "reject", "prefer"]
    assert maps[3].recipe["robot"]["name"] == "j2s7s300"
    assert all((each.counts > 0).any() for each in maps)


@pytest.mark.slow
def test_processes_build_the_same_map(run: Run, tmp_path: Path) -> None:
    words = ("--lower", "0.1", "-0.1", "0.2", "--upper", "0.7", "0.3", "0.6", "--spacing", "0.2", "--free-axis", "x")
    names = []
    for number in ("1", "2"):
        folder = tmp_path / number
        run("map", "build", folder, *words, "--orientations", "9", "--workers", number)
        names.append({path.name: path.read_bytes() for path in folder.iterdir()})
    assert names[0] == names[1]


@pytest.mark.slow
def test_a_base_is_placed(robot: Robot, run: Run, tmp_path: Path) -> None:
    lines = ["x,y,z,qw,qx,qy,qz"]
    for q in robot.sample(np.random.default_rng(2), 10):
        pose = jacokin.pose([0.5, 0.5, 0.2]) * robot.forward_kinematics(q)
        lines.append(",".join(repr(float(value)) for value in (*pose.translation, *quat_wxyz(pose.rotation))))
    (tmp_path / "targets.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    answer = run("place", "--targets", tmp_path / "targets.csv", "--json")
    assert answer.document["places"][0]["reached"] == 10
    assert answer.document["places"][0]["yaw"] == 0.0  # any would do: joint 1 turns freely


def test_the_map_is_that_of_the_robot(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "targets.csv").write_text("x,y,z,qw,qx,qy,qz\n0.3,0.2,0.3,0,1,0,0\n", encoding="utf-8")
    own = tmp_path / "ur5.urdf"
    own.write_text(ur5_text(), encoding="utf-8")
    words = ("place", "--targets", str(tmp_path / "targets.csv"), "--robot")
    said = run(*words, own, code=2).err
    assert f"--map is needed: no map of {own} comes with the package; `jacokin map build FOLDER --robot ...`" in said

    def place(reach: ReachabilityMap, *_: object, **__: object) -> tuple[()]:
        placed.append(reach.robot.name)
        return ()

    placed = list[str]()
    monkeypatch.setattr(reachability, "place_base", place)
    run(*words, "j2s7s300", code=2)
    assert placed == ["j2s7s300"]


def test_a_pose_that_is_asked_for_is_reached_or_not(run: Run, tmp_path: Path) -> None:
    words = ("--position", "0.4", "0.2", "0.3", "--down")
    assert "is reached, by the solver" in run("map", "query", "j2n6s300", *words).out
    folder, own = str(tmp_path / "map"), ("--robot", str(urdf_folder() / "jaco_arm.xml"), "--limit", "joint_1=0,5")
    run("map", "build", folder, "--spacing", "0.3", "--orientations", "8", *own)
    document = run("map", "query", folder, *words, "--json").document
    assert document["reached_by"] == "nearest sample of the map"  # without --robot there is no solver
    assert run("map", "query", folder, *words, *own, "--json").document["reached_by"] == "solver"


def test_a_map_of_limits_and_an_axis_of_ones_own_is_asked(run: Run, tmp_path: Path) -> None:
    folder, own = str(tmp_path / "map"), ("--limit", "joint_1=0,5")
    box = ("--lower", "0.1", "0.1", "0.2", "--upper", "0.5", "0.5", "0.6", "--spacing", "0.2")
    run("map", "build", folder, *box, "--down", "--free-axis", "x", *own)
    words = ("map", "query", folder, "--position", "0.3", "0.3", "0.3", "--down")
    document = run(*words, *own, "--json").document
    pose = jacokin.pose(document["nearest_position"], document["nearest_quat_wxyz"])
    assert jacokin.IKSolver(jacokin.load_robot(limits={"joint_1": (0.0, 5.0)})).solve(pose).success
    assert "load the map with --robot" in run(*words, code=2).err


@pytest.mark.slow
def test_a_base_is_placed_with_a_robot_and_a_scene_of_ones_own(run: Run, tmp_path: Path) -> None:
    folder, scene = str(tmp_path / "map"), tmp_path / "scene.yaml"
    scene.write_text("- {shape: floor, height: -0.1}\n", encoding="utf-8")
    arm = ("--robot", str(urdf_folder() / "jaco_arm.xml"), "--limit", "joint_1=0,5")
    run("map", "build", folder, "--spacing", "0.3", "--orientations", "8", *arm, "--scene", scene)
    own = (*arm, "--map-scene", str(scene))
    targets = tmp_path / "targets.csv"
    targets.write_text("x,y,z,qw,qx,qy,qz\n0.3,0.2,0.3,0,1,0,0\n0.1,0.4,0.3,0,1,0,0\n", encoding="utf-8")
    words = ("place", "--targets", str(targets), "--map", folder)
    place = run(*words, *own, "--json").document["places"][0]
    base = jacokin.pose(place["position"], rpy=[0.0, 0.0, place["yaw"]])
    robot = jacokin.load_robot(urdf_folder() / "jaco_arm.xml", limits={"joint_1": (0.0, 5.0)})
    solver = jacokin.IKSolver(robot, scene=Scene.load(scene), collision="reject")
    poses = [base.inverse() * jacokin.pose(at, down=True) for at in ([0.3, 0.2, 0.3], [0.1, 0.4, 0.3])]
    assert sum(solver.solve(pose).success for pose in poses) == place["reached"] > 0
    for given, message in ((own[4:], "load the map with --robot"), (own[:4], "load the map with --scene")):
        assert message in run(*words, *given, code=2).err


@pytest.mark.slow
def test_a_base_is_placed_in_a_scene_and_what_it_misses_is_reported(run: Run, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    scene, targets, picture = tmp_path / "scene.yaml", tmp_path / "targets.csv", tmp_path / "place.png"
    scene.write_text("- {shape: box, size: [0.8, 0.8, 0.4], position: [0.2, 0, 0.2]}\n", encoding="utf-8")
    rows = [f"{x},{y},{z},0,1,0,0\n" for x, y, z in ((0.2, 0.15, 0.5), (0.4, 0.15, 0.2), (9.0, 0.0, 0.5))]
    targets.write_text("x,y,z,qw,qx,qy,qz\n" + "".join(rows), encoding="utf-8")
    words = ("place", "--targets", str(targets), "--scene", str(scene), "--height", "0")
    bounds = ("--x", "-0.2", "0.6", "--y", "0.3", "0.8")
    answer = run(*words, *bounds, "--plot", picture, "--json", code=1)
    x, y, z = answer.document["places"][0]["position"]
    assert -0.2 <= x <= 0.6
    assert 0.44 <= y <= 0.8  # beside the box, not inside
    assert z == 0.0
    assert [each["line"] for each in answer.document["missed"]] == [3, 4]
    assert "in contact" in answer.document["missed"][0]["why"]
    assert answer.document["missed"][1]["why"] == "UNREACHABLE"
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "Not reached from the first place" in run(*words, *bounds, code=1).out
    assert "inside an obstacle" in run(*words, "--x", "0", "0.4", "--y", "-0.2", "0.2", code=2).err


@pytest.mark.parametrize(
    ("name", "why"), [("place.txt", "--plot must end in .png or .svg or .pdf"), ("no/place.png", "cannot be written")]
)
def test_a_picture_that_cannot_be_written_is_refused_before_places_are_looked_for(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, why: str
) -> None:
    pytest.importorskip("matplotlib")
    targets = tmp_path / "targets.csv"
    targets.write_text("x,y,z,qw,qx,qy,qz\n0.3,-0.2,0.5,0,1,0,0\n", encoding="utf-8")
    monkeypatch.setattr(reachability, "place_base", lambda *_, **__: pytest.fail("it was looked for"))
    answer = run("place", "--targets", targets, "--plot", tmp_path / name, code=2)
    assert name in answer.err
    assert why in answer.err
