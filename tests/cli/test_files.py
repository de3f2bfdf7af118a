"""`jacokin ik --targets` and `jacokin track`: files in, files out, and what happens when one of them is wrong."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin.cli import output_file, targets_csv
from jacokin.cli.main import main
from jacokin.errors import InvalidInputError
from jacokin.ik.paths.result import PathResult
from jacokin.model import poses

REACHED = 12
FAR = "9,9,9,1,0,0,0"


def leave(*words: str) -> int:
    with pytest.raises(SystemExit) as leaving:
        main(words)
    code = leaving.value.code
    assert code is None or isinstance(code, int)
    return code or 0


@pytest.fixture
def targets(tmp_path: Path) -> Path:
    """Twelve poses that are reached, in a file with a comment column and a blank line."""
    robot = jacokin.load_robot()
    path = tmp_path / "targets.csv"
    lines = ["note,x,y,z,qw,qx,qy,qz", ""]
    for q in robot.sample(np.random.default_rng(1), REACHED):
        pose = robot.forward_kinematics(q)
        numbers = [*pose.translation, *poses.quat_wxyz(pose.rotation)]
        lines.append("mine," + ",".join(f"{value:.17g}" for value in numbers))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_every_answer_in_the_file_is_legal_and_reaches_its_target(targets: Path) -> None:
    out = targets.with_name("joints.csv")
    assert leave("ik", "--targets", str(targets), "--output", str(out)) == 0
    with out.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == REACHED
    robot = jacokin.load_robot()
    for row in rows:
        q = [float(row[f"q{joint}"]) for joint in range(1, 7)]
        assert robot.within_limits(q)
        wanted = jacokin.pose([float(row[c]) for c in "xyz"], [float(row[c]) for c in ("qw", "qx", "qy", "qz")])
        error = robot.forward_kinematics(q).inverse() * wanted
        assert np.linalg.norm(error.translation) < 1e-6
        assert row["status"] == "OK"
        assert float(row["position_error"]) < 1e-6
        assert row["method"] == "closed_form"


def test_the_written_numbers_are_those_of_python(targets: Path) -> None:
    out = targets.with_name("joints.csv")
    leave("ik", "--targets", str(targets), "--output", str(out))
    batch = jacokin.IKSolver(jacokin.load_robot()).solve_batch(targets_csv.read(targets).targets)
    with out.open(newline="", encoding="utf-8") as file:
        written = [[float(row[f"q{joint}"]) for joint in range(1, 7)] for row in csv.DictReader(file)]
    assert written == batch.q.tolist()


def test_an_answer_file_is_a_target_file(targets: Path) -> None:
    first, second = targets.with_name("a.csv"), targets.with_name("b.csv")
    leave("ik", "--targets", str(targets), "--output", str(first))
    leave("ik", "--targets", str(first), "--output", str(second))
    assert first.read_text(encoding="utf-8") == second.read_text(encoding="utf-8")


def test_targets_without_quaternions_are_positions(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "positions.csv"
    path.write_text("\ufeffx, y, z\n0.3,-0.2,0.5\n0.3,-0.2,0.4\n", encoding="utf-8")  # as a spreadsheet writes it
    assert leave("ik", "--targets", str(path), "--json") == 0
    document = json.loads(capsys.readouterr().out)
    robot = jacokin.load_robot()
    for result, z in zip(document["results"], (0.5, 0.4), strict=True):
        assert np.allclose(robot.forward_kinematics(result["q"]).translation, [0.3, -0.2, z], rtol=0.0, atol=1e-6)


def test_an_unreachable_row_is_reported_and_the_code_is_1(targets: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with targets.open("a", encoding="utf-8") as file:
        file.write(f"far,{FAR}\n")
    out = targets.with_name("joints.csv")
    assert leave("ik", "--targets", str(targets), "--output", str(out)) == 1
    shown = capsys.readouterr().out
    assert f"{REACHED} of {REACHED + 1}" in shown
    assert f"{REACHED + 3} " in shown  # its line in the file, after header and blank line
    assert "UNREACHABLE" in shown
    assert out.read_text(encoding="utf-8").count("UNREACHABLE") == 1
    assert leave("ik", "--targets", str(targets), "--json") == 1
    summary = json.loads(capsys.readouterr().out)
    assert summary["statuses"] == {"OK": REACHED, "UNREACHABLE": 1}
    assert summary["worst_position_error"] < 1e-6


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: column x, y, z is missing"),
        ("x,y\n1,2\n", "line 1: column z is missing"),
        ("x,y,z,qw\n0,0,0,1\n", "column qx, qy, qz is missing"),
        ("x,y,z\n", "has no rows"),
        ("x,y,z\n0.3,-0.2,0.5\n0.3,north,0.5\n", "line 3, column y: 'north' is not a finite number"),
        ("x,y,z\n0.3,-0.2\n", "line 2, column z: is empty"),
        ("x,y,z\n0.3,nan,1\n", "line 2, column y: 'nan'"),
        ("x,y,z,qw,qx,qy,qz\n0,0,0,2,0,0,0\n", "line 2, columns qw, qx, qy, qz: quat_wxyz must have norm 1"),
    ],
)
def test_a_wrong_file_is_named_with_line_and_column(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, message: str
) -> None:
    path, out = tmp_path / "targets.csv", tmp_path / "joints.csv"
    path.write_text(text, encoding="utf-8")
    assert leave("ik", "--targets", str(path), "--output", str(out)) == 2
    error = capsys.readouterr().err
    assert "targets.csv" in error
    assert message in error
    assert [file.name for file in tmp_path.iterdir()] == ["targets.csv"]


def test_binary_targets_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "targets.csv"
    path.write_bytes(b"\xff\xfe\x00x")
    with pytest.raises(InvalidInputError, match="UTF-8"):
        targets_csv.read(path)


def test_the_output_is_checked_before_the_work(
    targets: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def solve(*_: object, **__: object) -> None:
        pytest.fail("solved before the output was checked")

    monkeypatch.setattr(jacokin.IKSolver, "solve_batch", solve)
    for out in (targets.parent / "nowhere" / "out.csv", targets.parent, targets):
        assert leave("ik", "--targets", str(targets), "--output", str(out)) == 2
        assert str(out) in capsys.readouterr().err


def test_a_failure_leaves_the_old_output_as_it_was(targets: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def solve(*_: object, **__: object) -> None:
        raise InvalidInputError("halfway")

    out = targets.with_name("joints.csv")
    out.write_text("precious", encoding="utf-8")
    monkeypatch.setattr(jacokin.IKSolver, "solve_batch", solve)
    assert leave("ik", "--targets", str(targets), "--output", str(out)) == 2
    assert out.read_text(encoding="utf-8") == "precious"
    assert sorted(file.name for file in targets.parent.iterdir()) == ["joints.csv", "targets.csv"]


def test_replacing_keeps_the_mode_and_follows_links(tmp_path: Path) -> None:
    real, link = tmp_path / "real.csv", tmp_path / "link.csv"
    real.write_text("old", encoding="utf-8")
    real.chmod(0o640)
    link.symlink_to(real)
    with output_file.replacing(link) as path:
        path.write_text("new", encoding="utf-8")
    assert link.is_symlink()
    assert real.read_text(encoding="utf-8") == "new"
    assert real.stat().st_mode & 0o777 == 0o640


def test_answers_can_go_to_a_device(targets: Path) -> None:
    assert leave("ik", "--targets", str(targets), "--output", "/dev/null") == 0


# -------------------------------------------------------------------------------------------------- track


@pytest.fixture
def path_file(tmp_path: Path) -> Path:
    """Ten centimetres to the right with the tool down."""
    path = tmp_path / "path.csv"
    half = 0.5**0.5
    rows = [f"{x},-0.2,0.5,0,{half!r},{half!r},0" for x in (0.3, 0.4)]
    path.write_text("\n".join(["x,y,z,qw,qx,qy,qz", *rows]) + "\n", encoding="utf-8")
    return path


def test_track_follows_a_line_inside_the_limits(path_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, plot = path_file.with_name("trajectory.csv"), path_file.with_name("trajectory.png")
    words = ("track", "--path", str(path_file), "--dt", "0.02", "--output", str(out), "--plot", str(plot), "--json")
    assert leave(*words) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["duration"] == pytest.approx(2.0)  # 0.1 m at 0.05 m/s
    assert document["max_position_error"] < 1e-4
    result = PathResult.load(out)
    robot = jacokin.load_robot()
    assert all(robot.within_limits(q) for q in result.q)
    assert (np.abs(result.v) <= robot.velocity_limit + 1e-9).all()
    last = robot.forward_kinematics(result.q[-1]).translation
    assert np.linalg.norm(last - [0.4, -0.2, 0.5]) < 1e-4
    assert plot.read_bytes().startswith(b"\x89PNG")


def test_track_of_a_path_that_leaves_the_reach_ends_with_1(path_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = path_file.read_text(encoding="utf-8")
    path_file.write_text(text.replace("\n0.4,", "\n1.4,"), encoding="utf-8")
    words = ("track", "--path", str(path_file), "--dt", "0.05", "--speed", "0.5")
    assert leave(*words) == 1
    shown = capsys.readouterr().out
    assert "NOT on the path" in shown
    assert "start branch" in shown


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--dt", "0"), "dt must be"),
        (("--dt", "-0.01"), "dt must be"),
        (("--speed", "0"), "speed"),
        (("--output", "trajectory.txt"), ".csv or .npz"),
        (("--output", "nowhere/trajectory.csv"), "nowhere"),
        (("--plot", "trajectory.doc"), ".png"),
        (("--frame", "link_9"), "link_6"),
        (("--seed", "1", "2"), "seed"),
    ],
)
def test_track_refuses_wrong_input_before_the_first_tick(
    path_file: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], message: str
) -> None:
    assert leave("track", "--path", str(path_file), *words) == 2
    captured = capsys.readouterr()
    assert message in captured.err
    assert captured.out == ""
    assert [file.name for file in path_file.parent.iterdir()] == ["path.csv"]


def test_track_needs_orientations_and_two_poses(path_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = path_file.read_text(encoding="utf-8").splitlines()
    path_file.write_text("\n".join(lines[:2]), encoding="utf-8")
    assert leave("track", "--path", str(path_file)) == 2
    path_file.write_text("x,y,z\n0.3,-0.2,0.5\n0.4,-0.2,0.5\n", encoding="utf-8")
    assert leave("track", "--path", str(path_file)) == 2
    assert "orientations" in capsys.readouterr().err


def test_plotting_without_matplotlib_names_the_extra(
    path_file: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    assert leave("track", "--path", str(path_file), "--plot", "a.png") == 2
    assert "jacokin[plot]" in capsys.readouterr().err
