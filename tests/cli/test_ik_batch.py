"""`jacokin ik --targets`: files in, files out, and what happens when one of them is wrong."""

from __future__ import annotations

import csv
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.errors import InvalidInputError
from jacokin.ik import read_targets, solve_file
from jacokin.model import poses
from tests.cli.run import Run

REACHED = 12
FAR = "9,9,9,1,0,0,0"


@pytest.fixture
def targets(robot: Robot, tmp_path: Path) -> Path:
    """Twelve poses that are reached, in a file with a comment column and a blank line."""
    path = tmp_path / "targets.csv"
    lines = ["note,x,y,z,qw,qx,qy,qz", ""]
    for q in robot.sample(np.random.default_rng(1), REACHED):
        pose = robot.forward_kinematics(q)
        numbers = [*pose.translation, *poses.quat_wxyz(pose.rotation)]
        lines.append("mine," + ",".join(f"{value:.17g}" for value in numbers))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_every_answer_in_the_file_is_within_limits_and_reaches_its_target(
    robot: Robot, run: Run, targets: Path
) -> None:
    out = targets.with_name("joints.csv")
    run("ik", "--targets", targets, "--output", out)
    with out.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == REACHED
    for row in rows:
        q = [float(row[f"q{joint}"]) for joint in range(1, 7)]
        assert robot.within_limits(q)
        wanted = jacokin.pose([float(row[c]) for c in "xyz"], [float(row[c]) for c in ("qw", "qx", "qy", "qz")])
        error = robot.forward_kinematics(q).inverse() * wanted
        assert np.linalg.norm(error.translation) < 1e-6
        assert row["status"] == "OK"
        assert float(row["position_error"]) < 1e-6
        assert row["method"] == "closed_form"


def test_the_written_numbers_are_those_of_python(run: Run, targets: Path) -> None:
    out = targets.with_name("joints.csv")
    run("ik", "--targets", targets, "--output", out)
    batch = jacokin.IKSolver(jacokin.load_robot()).solve_batch(read_targets(targets).targets)
    with out.open(newline="", encoding="utf-8") as file:
        written = [[float(row[f"q{joint}"]) for joint in range(1, 7)] for row in csv.DictReader(file)]
    assert written == batch.q.tolist()


def test_an_answer_file_is_a_target_file(run: Run, targets: Path) -> None:
    first, second = targets.with_name("a.csv"), targets.with_name("b.csv")
    run("ik", "--targets", targets, "--output", first)
    run("ik", "--targets", first, "--output", second)
    assert first.read_text(encoding="utf-8") == second.read_text(encoding="utf-8")


def test_remarks_are_carried_through_and_named_in_one_line(targets: Path, run: Run) -> None:
    out = targets.with_name("joints.csv")
    answer = run("ik", "--targets", targets, "--output", out)
    assert [line.split() for line in answer.out.splitlines() if line.strip().startswith("carried")] == [
        ["carried", "through", "note"]
    ]
    with out.open(newline="", encoding="utf-8") as file:
        assert {row["note"] for row in csv.DictReader(file)} == {"mine"}
    document = run("ik", "--targets", targets, "--json").document
    assert document["carried"] == ["note"]
    assert document["results"][0]["carried"] == {"note": "mine"}


def test_columns_that_answers_have_too_are_named(tmp_path: Path, run: Run) -> None:
    file = tmp_path / "targets.csv"
    file.write_text("x,y,z,status,q1,,note\n0.3,-0.2,0.5,keep,1.0,7,mine\n", encoding="utf-8")
    answer = run("ik", "--targets", file, "--output", tmp_path / "joints.csv")
    note = "columns not carried through: status (answers have one), q1 (answers have one), number 6 (it has no name)"
    assert note in answer.err
    assert "carried" not in run("ik", "--targets", tmp_path / "joints.csv", "--output", tmp_path / "again.csv").err


@pytest.mark.parametrize("ending", [".npz", ".parquet"])
def test_columns_that_answers_have_too_are_named_of_all_files(run: Run, tmp_path: Path, ending: str) -> None:
    file = tmp_path / f"targets{ending}"
    columns = {"x": [0.3], "y": [-0.2], "z": [0.5], "q1": [1.0], "note": ["mine"]}
    if ending == ".npz":
        arrays: dict[str, Any] = {name: np.array(column) for name, column in columns.items()}
        np.savez(file, **arrays)
    else:
        pytest.importorskip("pyarrow.parquet").write_table(pytest.importorskip("pyarrow").table(columns), file)
    answers = [file, *(tmp_path / f"answers{number}{ending}" for number in (1, 2))]
    said = [run("ik", "--targets", a, "--output", b).err for a, b in pairwise(answers)]
    assert "columns not carried through: q1 (answers have one)" in said[0]
    assert "carried" not in said[1]


def test_degrees_in_a_file_are_noted_without_an_option_that_is_not_for_files(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "targets.csv"
    file.write_text("x,y,z,roll,pitch,yaw\n0.3,-0.2,0.5,180,0,0\n", encoding="utf-8")
    said = run("ik", "--targets", file, code=1).err
    assert "roll, pitch, yaw is in radians, and an angle exceeds a full turn; files hold no degrees" in said


def test_targets_without_quaternions_are_positions(robot: Robot, tmp_path: Path, run: Run) -> None:
    path = tmp_path / "positions.csv"
    path.write_text("\ufeffx, y, z\n0.3,-0.2,0.5\n0.3,-0.2,0.4\n", encoding="utf-8")  # as a spreadsheet writes it
    document = run("ik", "--targets", path, "--json").document
    for result, z in zip(document["results"], (0.5, 0.4), strict=True):
        assert np.allclose(robot.forward_kinematics(result["q"]).translation, [0.3, -0.2, z], rtol=0.0, atol=1e-6)


def test_an_unreachable_row_is_reported_and_the_code_is_1(targets: Path, run: Run) -> None:
    with targets.open("a", encoding="utf-8") as file:
        file.write(f"far,{FAR}\n")
    out = targets.with_name("joints.csv")
    shown = run("ik", "--targets", targets, "--output", out, code=1).out
    assert f"{REACHED} of {REACHED + 1}" in shown
    assert f"{REACHED + 3} " in shown  # its line in the file, after header and blank line
    assert "UNREACHABLE" in shown
    assert out.read_text(encoding="utf-8").count("UNREACHABLE") == 1
    summary = run("ik", "--targets", targets, "--json", code=1).document
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
    ],
)
def test_a_wrong_file_is_named_with_line_and_column(tmp_path: Path, run: Run, text: str, message: str) -> None:
    path, out = tmp_path / "targets.csv", tmp_path / "joints.csv"
    path.write_text(text, encoding="utf-8")
    error = run("ik", "--targets", path, "--output", out, code=2).err
    assert "targets.csv" in error
    assert message in error
    assert [file.name for file in tmp_path.iterdir()] == ["targets.csv"]


def test_rows_that_are_not_targets_get_a_status_and_the_others_an_answer(targets: Path, run: Run) -> None:
    with targets.open("a", encoding="utf-8") as file:
        file.write("gap,0.3,nan,0.5,1,0,0,0\n")
        file.write("long,0.3,-0.2,0.5,2,0,0,0\n")
    out = targets.with_name("joints.csv")
    shown = run("ik", "--targets", targets, "--output", out, code=1).out
    assert "y is not finite" in shown
    assert "quat_wxyz must have norm 1" in shown
    with out.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["status"] for row in rows] == ["OK"] * REACHED + ["INVALID_TARGET"] * 2
    assert {row["q1"] for row in rows[REACHED:]} == {"nan"}
    answer = run("ik", "--targets", targets, "--json", code=1)
    assert answer.document["statuses"] == {"OK": REACHED, "INVALID_TARGET": 2}


def test_an_unfinished_run_is_continued_unless_told_not_to(
    run: Run, targets: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = targets.with_name("joints.csv")
    whole = targets.with_name("whole.csv")
    run("ik", "--targets", targets, "--output", whole)

    def stop(_: object) -> None:
        raise KeyboardInterrupt

    for words, resumed in (((), REACHED), (("--resume",), REACHED), (("--no-resume",), 0)):
        with pytest.raises(KeyboardInterrupt):
            solve_file(jacokin.IKSolver(jacokin.load_robot()), targets, out, closest=False, progress=stop)
        capsys.readouterr()
        assert run("ik", "--targets", targets, "--output", out, "--json", *words).document["resumed"] == resumed
        assert out.read_bytes() == whole.read_bytes()
        out.unlink()
    out.touch()
    assert sorted(file.name for file in targets.parent.iterdir()) == ["joints.csv", "targets.csv", "whole.csv"]


def test_a_scheduler_that_does_not_answer_is_a_sentence(
    targets: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("jacokin.chunks.execution.ANSWER_WITHIN", 0.5)
    for address in ("tcp://127.0.0.1:9", "nonsense://x"):
        out = targets.with_name("joints.csv")
        answer = run("ik", "--targets", targets, "--output", out, "--dask", address, code=2)
        assert f"no dask scheduler answers at {address}" in answer.err
    assert [file.name for file in targets.parent.iterdir()] == ["targets.csv"]


def test_the_output_is_checked_before_the_work(targets: Path, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def solve(*_: object, **__: object) -> None:
        pytest.fail("solved before the output was checked")

    monkeypatch.setattr(jacokin.IKSolver, "solve_batch", solve)
    for out in (targets.parent / "nowhere" / "out.csv", targets.parent, targets):
        assert str(out) in run("ik", "--targets", targets, "--output", out, code=2).err


def test_a_failure_leaves_the_old_output_as_it_was(run: Run, targets: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def solve(*_: object, **__: object) -> None:
        raise InvalidInputError("halfway")

    out = targets.with_name("joints.csv")
    out.write_text("precious", encoding="utf-8")
    monkeypatch.setattr(jacokin.IKSolver, "solve_batch", solve)
    run("ik", "--targets", targets, "--output", out, code=2)
    assert out.read_text(encoding="utf-8") == "precious"
    assert sorted(file.name for file in targets.parent.iterdir()) == ["joints.csv", "targets.csv"]


def test_answers_can_go_to_a_device(run: Run, targets: Path) -> None:
    run("ik", "--targets", targets, "--output", "/dev/null")


def test_files_are_solved_without_closest_configurations_unless_asked(targets: Path, run: Run) -> None:
    with targets.open("a", encoding="utf-8") as file:
        file.write(f"far,{FAR}\n")
    out = targets.with_name("joints.csv")
    home = jacokin.load_robot().home.tolist()
    for words, is_home in (((), True), (("--no-closest",), True), (("--closest",), False)):
        assert ("--closest" in run("ik", "--targets", targets, "--output", out, *words, code=1).out) == is_home
        with out.open(newline="", encoding="utf-8") as file:
            last = list(csv.DictReader(file))[-1]
        assert ([float(last[f"q{joint}"]) for joint in range(1, 7)] == home) == is_home
        document = run("ik", "--targets", targets, "--json", *words, code=1).document
        assert (document["results"][-1]["q"] == home) == is_home


def test_answers_that_are_not_saved_are_announced(targets: Path, run: Run) -> None:
    answer = run("ik", "--targets", targets)
    assert answer.err == "jacokin: note: the answers are counted, not saved: --output FILE keeps them\n"
    for words in (("--json",), ("--output", str(targets.with_name("joints.csv")))):
        assert run("ik", "--targets", targets, *words).err == ""


@pytest.mark.parametrize("output", [(), ("--output", "joints.csv")])
def test_a_device_without_an_end_is_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Run, output: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    answer = run("ik", "--targets", "/dev/zero", *output, code=2)
    assert answer.err.endswith("jacokin: /dev/zero: is a device: give a file or a pipe\n")
    assert not list(tmp_path.iterdir())
