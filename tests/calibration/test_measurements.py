"""Sets of measurements: their kinds, their files, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.calibration import Measurements, calibrate
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.model import pose_to_kinova
from tests.calibration.simulated import Array, poses_of

Q = np.zeros((3, 6))
P = np.ones((3, 3))


def write_csv(path: Path, header: str, rows: Array) -> Path:
    path.write_text(header + "\n" + "\n".join(",".join(map(repr, row)) for row in rows.tolist()) + "\n")
    return path


@pytest.fixture
def seen(robot: Robot, rng: np.random.Generator) -> tuple[Array, Array]:
    q = robot.sample(rng, 5)
    return q, poses_of(robot, q)


def test_a_csv_of_positions(seen: tuple[Array, Array], tmp_path: Path) -> None:
    q, T = seen
    header = ",".join(f"joint_{k}" for k in range(1, 7)) + ",x,y,z,remark"
    path = tmp_path / "m.csv"
    rows = [",".join(map(repr, [*a, *b])) + ",fine" for a, b in zip(q.tolist(), T[:, :3, 3].tolist(), strict=True)]
    rows[2] = rows[2].replace(repr(T[2, 0, 3].item()), "")
    path.write_text("\n".join([header, *rows]) + "\n")
    read = Measurements.load(path, sigma=3e-4, frame="link_6")
    assert (read.kind, read.frame, len(read)) == ("positions", "link_6", 5)
    assert read.q.tobytes() == q.tobytes()
    assert read.finite.tolist() == [True, True, False, True, True]
    assert (read.values[3] == T[3, :3, 3]).all()
    assert (read.sigma == 3e-4).all()


def test_poses_in_every_notation(seen: tuple[Array, Array], tmp_path: Path) -> None:
    q, T = seen
    joints = ",".join(f"q{k}" for k in range(1, 7))
    quats = np.array([jacokin.model.quat_wxyz(each[:3, :3]) for each in T])
    a = write_csv(tmp_path / "a.csv", f"{joints},x,y,z,qw,qx,qy,qz", np.hstack([q, T[:, :3, 3], quats]))
    kinova = [pose_to_kinova(each) for each in T]
    numbers = np.array([[*position, *angles] for position, angles in kinova])
    b = write_csv(tmp_path / "b.csv", f"{joints},x,y,z,theta_x,theta_y,theta_z", np.hstack([np.degrees(q), numbers]))
    import pinocchio as pin

    rpy = np.degrees([pin.rpy.matrixToRpy(each[:3, :3]) for each in T])
    c = write_csv(tmp_path / "c.csv", f"{joints},x,y,z,roll,pitch,yaw", np.hstack([np.degrees(q), T[:, :3, 3], rpy]))
    sigma = (1e-3, 2e-3)
    for read in (
        Measurements.load(a, sigma=sigma),
        Measurements.load(b, sigma=sigma, kinova=True),
        Measurements.load(c, sigma=sigma, degrees=True),
    ):
        assert read.kind == "poses"
        np.testing.assert_allclose(read.values, T, atol=1e-12)
        np.testing.assert_allclose(read.q, q, atol=1e-12)
        assert read.sigma[0].tolist() == [1e-3] * 3 + [2e-3] * 3


def test_npz_and_parquet(seen: tuple[Array, Array], tmp_path: Path) -> None:
    q, T = seen
    columns = {f"joint_{k + 1}": q[:, k] for k in range(6)}
    columns |= {
        "distance": np.ones(5),
        "px": np.zeros(5),
        "py": np.zeros(5),
        "pz": np.full(5, 0.1),
        "sigma": T[:, 3, 3],
    }
    np.savez(tmp_path / "m.npz", **columns)  # type: ignore[arg-type]  # none is called allow_pickle
    read = Measurements.load(tmp_path / "m.npz")
    assert read.kind == "distances"
    assert read.points is not None
    assert read.points[4].tolist() == [0.0, 0.0, 0.1]
    pa = pytest.importorskip("pyarrow")
    import pyarrow.parquet as parquet

    parquet.write_table(pa.table(columns), tmp_path / "m.parquet")
    other = Measurements.load(tmp_path / "m.parquet", contact="point")
    assert other.kind == "point"
    assert other.q.tobytes() == read.q.tobytes()


def test_select_keeps_rows_in_step(seen: tuple[Array, Array]) -> None:
    q, T = seen
    rows = Measurements(q, poses=T, sigma=(np.arange(1.0, 6.0), 1e-3), base=jacokin.pose([1, 0, 0]))
    part = rows.select([4, 0])
    assert part.sigma[:, 0].tolist() == [5.0, 1.0]
    assert (part.values == T[[4, 0]]).all()
    assert part.base is not None
    assert part.base.translation.tolist() == [1.0, 0.0, 0.0]
    assert len(rows.select(np.array([True, False, False, False, True]))) == 2
    with pytest.raises(ValueError, match="read-only"):
        rows.q[0] = 0.0
    with pytest.raises(InvalidInputError, match="rows: index 7"):
        rows.select([7])
    for wrong in ([[1.0, 2.0], [3.0]], 2**63, "all"):
        with pytest.raises(InvalidInputError, match="rows: "):
            rows.select(wrong)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"sigma": 1e-3}, "exactly one of positions, poses, distances, contact must be given, got none"),
        ({"sigma": 1e-3, "positions": P, "contact": "plane"}, "got positions, contact"),
        ({"sigma": 0.0, "positions": P}, "sigma must be positive"),
        ({"sigma": np.nan, "positions": P}, "sigma must be positive and finite"),
        ({"sigma": [1e-3] * 4, "positions": P}, r"sigma must have shape \(\), \(3,\) or \(3, 3\)"),
        ({"sigma": (1e-3, 1e-3), "positions": P}, r"got \(2,\), as a pair of errors, which is for poses"),
        ({"sigma": 1e-3, "positions": P[:2]}, "q has 3 rows and positions 2"),
        ({"sigma": 1e-3, "positions": [["a"] * 3] * 3}, "positions must be rows of 3 numbers"),
        ({"sigma": 1e-3, "poses": np.tile(np.eye(4), (3, 1, 1))}, "sigma must be a pair"),
        ({"sigma": (1e-3, 1e-3), "poses": np.ones((3, 4, 4))}, r"poses\[0\]"),
        ({"sigma": 1e-3, "distances": np.ones(3)}, "points must be given with distances"),
        ({"sigma": 1e-3, "positions": P, "points": P}, "points must be given with distances, and only"),
        ({"sigma": 1e-3, "distances": np.ones(3), "points": P[:2]}, r"of shape \(3,\) or \(3, 3\)"),
        ({"sigma": 1e-3, "distances": np.ones(3), "points": [0, 0, np.nan]}, "points must be finite"),
        ({"sigma": 1e-3, "contact": "plane", "base": "unknown"}, "no instrument measures it"),
    ],
)
def test_what_is_refused(arguments: dict[str, object], sentence: str) -> None:
    with pytest.raises(InvalidInputError, match=sentence):
        Measurements(Q, **arguments)  # type: ignore[arg-type]  # users' mistakes


def test_unknown_words_are_named() -> None:
    with pytest.raises(UnknownNameError, match="unknown contact 'line'.*Valid: plane, point"):
        Measurements(Q, contact="line", sigma=1e-3)
    with pytest.raises(UnknownNameError, match="unknown base 'somewhere'"):
        Measurements(Q, positions=P, sigma=1e-3, base="somewhere")


def test_files_that_say_too_little(tmp_path: Path) -> None:
    row = np.ones((1, 10))
    joints = ",".join(f"q{k}" for k in range(1, 7))
    cases = {
        "a,b,c,d,e,f,x,y,z,sigma": "has no joint angles",
        f"{joints},x,y,w,sigma": "column z is missing; found: q1",
        f"{joints},x,y,z,w": "has no column sigma",
        f"{joints},x,y,z,qw": "has no column sigma",
    }
    for header, sentence in cases.items():
        path = write_csv(tmp_path / "m.csv", header, row)
        with pytest.raises(InvalidInputError, match=sentence):
            Measurements.load(path)
    with pytest.raises(InvalidInputError, match="cannot be read: No such file"):
        Measurements.load(tmp_path / "none.csv")
    np.savez(tmp_path / "whole.npz", q1=np.zeros(100))
    half = (tmp_path / "whole.npz").read_bytes()[:300]
    for content in (b"PK nothing", b"PK\x03\x04 nothing", half):
        (tmp_path / "broken.npz").write_bytes(content)
        with pytest.raises(InvalidInputError, match=r"broken.npz: is not a file of measurements"):
            Measurements.load(tmp_path / "broken.npz")
    path = write_csv(tmp_path / "m.csv", f"{joints},x, q2 ,y,z", np.ones((1, 10)))
    with pytest.raises(InvalidInputError, match="column 'q2' is there twice"):
        Measurements.load(path, sigma=1e-3)
    (tmp_path / "empty.csv").write_text("")
    with pytest.raises(InvalidInputError, match="has no rows of measurements"):
        Measurements.load(tmp_path / "empty.csv")


@pytest.mark.parametrize("name", ["q3", "x", "qw", "theta_y", "sigma"])
def test_words_in_a_column_that_is_read_are_refused(name: str, tmp_path: Path) -> None:
    """Without that column it would be another kind of measurement: poses without qw are positions."""
    header = [f"q{k}" for k in range(1, 7)] + ["x", "y", "z", "sigma", *({name} - {"q3", "x", "sigma"}), "remark"]
    cells = ["fine" if column == "remark" else "1.0" for column in header]
    for wrong in ("n/a", "1_0", "\u0661"):
        bad = [wrong if column == name else cell for column, cell in zip(header, cells, strict=True)]
        path = tmp_path / "m.csv"
        path.write_text("\n".join(map(",".join, [header, cells, bad])), encoding="utf-8")
        with pytest.raises(InvalidInputError, match=rf"m.csv: line 3, column {name}: '{wrong}' is not a number"):
            Measurements.load(path)
    arrays = {column: np.ones(2) for column in header} | {name: np.array(["1.0", "n/a"])}
    np.savez(tmp_path / "m.npz", **arrays)
    with pytest.raises(InvalidInputError, match=rf"m.npz: column {name} must be numbers, got <U3"):
        Measurements.load(tmp_path / "m.npz")
    pq = pytest.importorskip("pyarrow.parquet", reason="the extra parquet is not installed")
    import pyarrow as pa

    pq.write_table(pa.table(arrays), tmp_path / "m.parquet")
    with pytest.raises(InvalidInputError, match=rf"m.parquet: column {name} must be numbers, got string"):
        Measurements.load(tmp_path / "m.parquet")


@pytest.mark.parametrize("names", ["qx,qy,qz", "roll,pitch", "theta_x,theta_z"])
def test_orientations_that_lack_a_column_are_not_lost(names: str, tmp_path: Path) -> None:
    header = f"{','.join(f'q{k}' for k in range(1, 7))},x,y,z,{names}"
    path = write_csv(tmp_path / "m.csv", header, np.ones((2, 9 + len(names.split(",")))))
    with pytest.raises(InvalidInputError, match=r"m.csv: column (qw|yaw|theta_y) is missing; found: q1"):
        Measurements.load(path, sigma=1e-3)


def test_sigma_of_a_file_of_kinova_is_in_its_units(tmp_path: Path) -> None:
    header = f"{','.join(f'q{k}' for k in range(1, 7))},x,y,z,theta_x,theta_y,theta_z,sigma,sigma_angle"
    path = write_csv(tmp_path / "m.csv", header, np.array([[0.0] * 12 + [0.5, 0.1]]))
    np.testing.assert_allclose(Measurements.load(path, kinova=True).sigma, [[5e-4] * 3 + [np.radians(0.1)] * 3])
    assert Measurements.load(path).sigma[0, [0, 3]].tolist() == [0.5, 0.1]


def test_a_distance_without_its_point_is_a_row_that_is_not_finite(seen: tuple[Array, Array], tmp_path: Path) -> None:
    q, _ = seen
    header = f"{','.join(f'q{k}' for k in range(1, 7))},distance,px,py,pz"
    rows = np.hstack([q, np.ones((5, 1)), np.zeros((5, 3))])
    path = write_csv(tmp_path / "m.csv", header, rows)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:3], lines[3].removesuffix("0.0"), *lines[4:]]))
    assert Measurements.load(path, sigma=1e-3).finite.tolist() == [True, True, False, True, True]


@pytest.mark.slow
def test_rows_are_named_by_the_lines_of_their_file(robot: Robot, tmp_path: Path, rng: np.random.Generator) -> None:
    q = robot.sample(rng, 12)
    rows = np.hstack([q, poses_of(robot, q)[:, :3, 3]])
    rows[7, 6] += 0.07
    header = ",".join([*(f"joint_{k}" for k in range(1, 7)), "x", "y", "z"])
    path = write_csv(tmp_path / "m.csv", header, rows)
    read = Measurements.load(path, sigma=1e-3)
    assert (read.source, read.name_row(7)) == (path, "line 9")
    assert read.select([7]).name_row(0) == "line 9"
    assert str(calibrate(robot, read).rejected[0]).startswith(f"{path}, line 9, is 70.0 mm from")
    np.savez(tmp_path / "m.npz", **dict(zip(header.split(","), rows.T, strict=True)))
    assert Measurements.load(tmp_path / "m.npz", sigma=1e-3).name_row(7) == "row 7 (from 0)"
    lines = path.read_text().splitlines()
    for line, text in ((5, ",1.0"), (2, ",1.0,2.0")):
        damaged = [each + text * (number == line) for number, each in enumerate(lines, 1)]
        (tmp_path / "long.csv").write_text("\n".join(damaged))
        with pytest.raises(InvalidInputError, match=rf"long.csv: line {line} has 1[01] cells, and there are 9 columns"):
            Measurements.load(tmp_path / "long.csv", sigma=1e-3)
    degrees = write_csv(tmp_path / "degrees.csv", header, np.hstack([np.degrees(q), rows[:, 6:]]))
    with pytest.raises(InvalidInputError, match=r"degrees.csv: joint angles .* look like degrees: .* degrees=True"):
        calibrate(robot, Measurements.load(degrees, sigma=1e-3))
    lengths = write_csv(tmp_path / "mm.csv", header, np.hstack([q, 1000.0 * rows[:, 6:]]))
    with pytest.raises(InvalidInputError, match=r"mm.csv: positions are .* look like millimetres.*kinova=True"):
        calibrate(robot, Measurements.load(lengths, sigma=1e-3))
    np.savez(tmp_path / "ragged.npz", q1=np.zeros(3), q2=np.zeros(2))
    with pytest.raises(InvalidInputError, match="must have one dimension and one length"):
        Measurements.load(tmp_path / "ragged.npz", sigma=1e-3)


@pytest.mark.parametrize("names", ["joint_1,joint_3", "joint_0,joint_1", "joint_1,q2", "q1,q2,q4"])
def test_joints_with_a_gap_are_refused(names: str, tmp_path: Path) -> None:
    """They would be taken for the first joints: of a column of words, for example, nothing is left."""
    head = f"{names},x,y,z"
    (tmp_path / "m.csv").write_text(head + "\n" + ",".join(["0.1"] * len(head.split(","))) + "\n")
    with pytest.raises(InvalidInputError, match=rf"m.csv: joint angles must be columns .* {names.replace(',', ', ')}"):
        Measurements.load(tmp_path / "m.csv", sigma=1e-3)
