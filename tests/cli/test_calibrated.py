"""A calibrated arm on the command line: every command takes the file, and says that the arm is calibrated."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import jacokin
from tests.cli.run import HOME, POSE, Run
from tests.model.measured_arms import drawn_arm

LABEL = "calibrated j2n6s300"
LINE = "x,y,z,qw,qx,qy,qz\n0.3,-0.2,0.5,0,1,0,0\n0.31,-0.2,0.5,0,1,0,0\n"


@pytest.fixture
def file(robot: jacokin.Robot, tmp_path: Path) -> Path:
    """The calibration of an arm that is some millimetres off."""
    path = tmp_path / "my_arm.toml"
    drawn_arm(robot, np.random.default_rng(1)).save(path)
    return path


@pytest.mark.one_quick
@pytest.mark.parametrize(
    "words",
    [
        ("ik", *POSE),
        ("ik", *POSE, "--all"),
        ("ik", "--targets", "{line}"),
        ("fk", *HOME),
        ("jacobian", *HOME),
        ("move", *POSE),
        ("plan", "--path", "{line}", "--dt", "0.1"),
        ("track", "--path", "{line}", "--dt", "0.1"),
    ],
    ids=lambda words: " ".join(words[:1] + words[-1:]) if isinstance(words, tuple) else None,
)
def test_results_say_that_the_arm_is_calibrated(run: Run, file: Path, tmp_path: Path, words: Sequence[str]) -> None:
    line = tmp_path / "line.csv"
    line.write_text(LINE, encoding="utf-8")
    words = [word.format(line=line) for word in words]
    assert LABEL in run(*words, "--calibration", file).out.splitlines()[0]
    document = run(*words, "--calibration", file, "--json").document
    assert (document["robot"], document["calibration"]) == ("j2n6s300", str(file))
    described = run(*words)
    assert described.out.splitlines()[0].startswith("j2n6s300")
    assert "calibrat" not in described.out
    assert "calibration" not in run(*words, "--json").document


def test_a_map_of_a_calibrated_arm_knows_its_arm(run: Run, file: Path, tmp_path: Path) -> None:
    folder, own = str(tmp_path / "map"), ("--calibration", str(file))
    run("map", "build", folder, "--spacing", "0.3", "--orientations", "8", *own)
    query = ("--position", "0.4", "0.2", "0.3", "--down", "--json")
    assert run("map", "query", folder, *query).document["reached_by"] == "nearest sample of the map"
    assert run("map", "query", folder, *query, *own).document["reached_by"] == "solver"
    for words in (("map", "query", "j2n6s300", *query), ("view", "--map", "j2n6s300", "--port", "0")):
        refused = run(*words, *own, code=2)  # the bundled map is of the datasheet's arm
        assert f"map of another robot than this {LABEL}" in refused.err
    run("map", "build", folder, "--spacing", "0.3", "--orientations", "8", code=2)


def test_info_says_that_the_arm_is_calibrated(run: Run, file: Path) -> None:
    assert run("info", "--calibration", file).out.startswith(LABEL)


def test_crosscheck_of_a_calibrated_arm(run: Run, file: Path) -> None:
    both = run("crosscheck", "--calibration", file, "--samples", "20")  # Pinocchio and MuJoCo have the same arm
    assert both.out.startswith(f"{LABEL} (urdf) in Pinocchio against {LABEL} in MuJoCo")
    words = ("crosscheck", "j2n6s300", "j2n6s300", "--calibration", str(file), "--samples", "200", "--json")
    document = run(*words, code=1).document
    assert document["first"] == f"{LABEL} (urdf) in Pinocchio"
    assert document["second"] == "j2n6s300 (urdf) in Pinocchio"
    far = {row["frame"]: row for row in document["deviations"] if row["quantity"] == "position"}["end_effector"]
    described, calibrated = jacokin.load_robot(), jacokin.load_robot(calibration=file)
    ends = [arm.forward_kinematics(far["q"]).translation for arm in (described, calibrated)]
    assert far["value"] == pytest.approx(np.linalg.norm(ends[1] - ends[0]), rel=1e-9)
    assert far["value"] > 1e-3
