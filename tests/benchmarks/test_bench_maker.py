"""MotionBenchMaker's problems are read, and its referee measures how deep an arm is in what is around it."""

from __future__ import annotations

import io
import tarfile
from pathlib import Path

import numpy as np
import pytest

from benchmarks.bench_maker import JOINTS, Referee, Solid, files_in, load_problems

SCENE = """
world:
  collision_objects:
    - id: can
      primitives: [{type: cylinder, dimensions: [0.2, 0.03]}]
      primitive_poses: [{position: [1, 0, 0.5], orientation: [0, 0.7071067811865476, 0, 0.7071067811865476]}]
    - id: ball
      pose: {position: [0, 0, 1], orientation: [0, 0, 0, 1]}
      primitives: [{type: sphere, dimensions: [0.1]}]
      primitive_poses: [{position: [0, 0, 1], orientation: [0, 0, 0, 1]}]
    - id: table
      primitives: [{type: box, dimensions: [1, 2, 0.1]}]
      primitive_poses: [{position: [0, 0, -0.2], orientation: [0, 0, 0, 1]}]
"""


def request() -> str:
    goals = [f"{{joint_name: {name}, position: {0.1 * k}}}" for k, name in enumerate(JOINTS)]
    return (
        f"start_state: {{joint_state: {{name: [hand, {', '.join(JOINTS)}], position: [9, 1, 2, 3, 4, 5, 6]}}}}\n"
        f"goal_constraints: [{{joint_constraints: [{', '.join(goals)}]}}]\n"
    )


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    path = tmp_path / "problems.tar.bz2"
    with tarfile.open(path, "w:bz2") as tar:
        for kind in ("box", "cage"):
            for name, text in (("scene", SCENE), ("request", request())):
                for number in (1, 2):
                    entry = tarfile.TarInfo(f"problems/{kind}_ur5/{name}{number:04}.yaml")
                    entry.size = len(text)
                    tar.addfile(entry, io.BytesIO(text.encode()))
    return path


def test_problems_are_read(archive: Path) -> None:
    found = load_problems(archive, 1)
    assert [(problem.kind, problem.number) for problem in found] == [("box", 1), ("cage", 1)]
    box, cage = found
    np.testing.assert_array_equal(box.start, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    np.testing.assert_allclose(box.goal, [0.0, 0.1, 0.2, 0.3, 0.4, 0.5])
    assert [(each.name, each.kind, each.size) for each in cage.solids] == [
        ("can", "capsule", (0.03, 0.2)),
        ("ball", "sphere", (0.1,)),
        ("table", "box", (0.5, 1.0, 0.05)),
    ]
    assert box.solids[0].kind == "box"
    np.testing.assert_allclose(cage.solids[0].place[:3, 2], [1.0, 0.0, 0.0], atol=1e-12)  # it lies along x
    np.testing.assert_allclose(cage.solids[1].place[:3, 3], [0.0, 0.0, 2.0])


def test_what_is_missing_is_said(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match=r"problems\.tar\.bz2 is missing in .*clone"):
        files_in(tmp_path)


def arm(folder: Path) -> Referee:
    """Six links of 10 cm along x in the first pose, all joints about z; a ball of 2 cm at the end of each."""
    ball = '<collision><origin xyz="0.1 0 0"/><geometry><sphere radius="0.02"/></geometry></collision>'
    links = ['<link name="l0"/>', *(f'<link name="l{k}">{ball}</link>' for k in range(1, 7))]
    joints = [
        f'<joint name="{name}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/>'
        f'<origin xyz="{0.1 if k else 0} 0 0"/><axis xyz="0 0 1"/></joint>'
        for k, name in enumerate(JOINTS)
    ]
    urdf, srdf = folder / "arm.urdf", folder / "arm.srdf"
    urdf.write_text(f"<robot name='arm'>{''.join(links + joints)}</robot>")
    srdf.write_text("<robot name='arm'><disable_collisions link1='l1' link2='l6'/></robot>")
    return Referee(urdf, srdf)


def test_the_referee_knows_where_spheres_are(tmp_path: Path) -> None:
    referee = arm(tmp_path)
    ends = referee.centres(np.array([np.zeros(6), [np.pi / 2, 0, 0, 0, 0, 0]]))
    np.testing.assert_allclose(ends[0, :, 0], 0.1 * np.arange(1, 7))
    np.testing.assert_allclose(ends[1, :, 1], 0.1 * np.arange(1, 7))


@pytest.mark.parametrize(("kind", "size"), [("box", (0.05, 0.05, 0.05)), ("sphere", (0.05,)), ("capsule", (0.05, 0.2))])
def test_depth_in_a_solid(tmp_path: Path, kind: str, size: tuple[float, ...]) -> None:
    place = np.eye(4)
    place[:3, 3] = [0.6, 0.06, 0.0]  # beside the last ball, 1 cm deep
    assert arm(tmp_path).depth(np.zeros((1, 6)), [Solid("it", kind, size, place)]) == pytest.approx(0.01)


def test_depth_in_itself_and_along_a_path(tmp_path: Path) -> None:
    referee = arm(tmp_path)
    folded = np.array([0.0, 0.0, np.pi, 0.0, 0.0, 0.0])  # the third link lies on the second
    assert referee.depth(folded[None], []) == pytest.approx(0.04)
    assert referee.depth(np.zeros((1, 6)), []) == pytest.approx(-0.06)
    place = np.eye(4)
    place[:3, 3] = [0.0, 0.6, 0.0]
    pole = Solid("pole", "capsule", (0.01, 1.0), place)
    across = np.array([[0.0, 0, 0, 0, 0, 0], [np.pi, 0, 0, 0, 0, 0]])
    assert referee.depth(across, [pole]) < 0.0
    assert referee.depth_along(across, [pole], 0.01) == pytest.approx(0.03, abs=4e-3)
