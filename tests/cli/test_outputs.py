"""No command writes over a file that it reads."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from jacokin.model import urdf_folder
from tests.cli.run import Run

TARGETS = "x,y,z,qw,qx,qy,qz\n0.3,-0.2,0.5,1,0,0,0\n0.3,-0.2,0.5,1,0,0,0\n"


def itself(file: Path) -> Path:
    return file


def symbolic_link(file: Path) -> Path:
    link = file.with_name(f"link{file.suffix}")
    link.symlink_to(file)
    return link


def hard_link(file: Path) -> Path:
    link = file.with_name(f"hard{file.suffix}")
    os.link(file, link)
    return link


def detour(file: Path) -> Path:
    (file.parent / "folder").mkdir()
    return file.parent / "folder" / ".." / file.name


@pytest.mark.parametrize("reached", [itself, symbolic_link, hard_link, detour])
@pytest.mark.parametrize("command", ["ik", "track"])
def test_targets_are_not_written_over(run: Run, tmp_path: Path, command: str, reached: Callable[[Path], Path]) -> None:
    file = tmp_path / "poses.csv"
    file.write_text(TARGETS, encoding="utf-8")
    option = {"ik": "--targets", "track": "--path"}[command]
    answer = run(command, option, file, "--output", reached(file), code=2)
    assert "--output" in answer.err
    assert option in answer.err
    assert file.read_text(encoding="utf-8") == TARGETS


@pytest.mark.parametrize("reached", [itself, symbolic_link])
def test_the_robot_is_not_written_over(run: Run, tmp_path: Path, reached: Callable[[Path], Path]) -> None:
    targets, robot = tmp_path / "poses.csv", tmp_path / "arm.urdf"
    targets.write_text(TARGETS, encoding="utf-8")
    text = (urdf_folder() / "j2n6s300.urdf").read_text(encoding="utf-8")
    robot.write_text(text, encoding="utf-8")
    assert "--robot" in run("ik", "--targets", targets, "--robot", robot, "--output", reached(robot), code=2).err
    assert robot.read_text(encoding="utf-8") == text


def test_a_file_that_the_robot_includes_is_not_written_over(run: Run, tmp_path: Path, scene: Path) -> None:
    targets, included = tmp_path / "poses.csv", scene.with_name("common.xml")
    targets.write_text(TARGETS, encoding="utf-8")
    before = included.read_text(encoding="utf-8")
    words = ("ik", "--targets", str(targets), "--robot", str(scene), "--base", "pedestal", "--tip", "tool")
    assert "common.xml" in run(*words, "--output", included, code=2).err
    assert included.read_text(encoding="utf-8") == before


@pytest.mark.parametrize("name", ["out.txt", "out", "-"])
def test_answers_have_an_ending_that_says_how_they_are_written(run: Run, tmp_path: Path, name: str) -> None:
    targets = tmp_path / "poses.csv"
    targets.write_text(TARGETS, encoding="utf-8")
    answer = run("ik", "--targets", targets, "--output", tmp_path / name, code=2)
    assert f"{name}: answers are written as .csv, .npz, .parquet, told by the ending of the name" in answer.err
    assert list(tmp_path.iterdir()) == [targets]


def test_two_outputs_are_two_files(run: Run, tmp_path: Path) -> None:
    targets, link = tmp_path / "poses.csv", tmp_path / "plot.png"
    targets.write_text(TARGETS, encoding="utf-8")
    link.symlink_to(tmp_path / "out.csv")
    answer = run("track", "--path", targets, "--output", tmp_path / "out.csv", "--plot", link, code=2)
    assert "same file" in answer.err
