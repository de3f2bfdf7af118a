"""`jacokin map` and `jacokin place`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin.model import quat_wxyz
from tests.cli.run import Run


def test_a_map_is_built_in_shards_asked_and_drawn(run: Run, tmp_path: Path) -> None:
    words = ["map", "build", str(tmp_path / "map"), "--spacing", "0.15", "--orientations", "2000", "--workers", "2"]
    assert "others are missing" in run(*words, "--shard", "1/2").out
    assert run("map", "query", str(tmp_path / "map"), "--position", "0.3", "0.2", "0.4").code == 2
    assert "poses" in run(*words).out
    answer = run("map", "query", str(tmp_path / "map"), "--position", "1.9", "0.2", "0.4", "--down", "--json")
    assert answer.document["dexterity"] == 0.0
    pose = jacokin.pose(answer.document["nearest_position"], answer.document["nearest_quat_wxyz"])
    assert jacokin.solve_ik(pose).success
    assert run("map", "show", str(tmp_path / "map"), "--output", str(tmp_path / "map.html")).code == 0
    assert (tmp_path / "map.html").is_file()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("map", "build", "x", "--spacing", "1e-5"), "cells"),
        (("map", "build", "x", "--lower", "0", "0", "0"), "--lower and --upper go together"),
        (("map", "build", "x", "--shard", "3/2"), "--shard must be 'i/n'"),
        (("map", "query", "nowhere", "--position", "0", "0", "0"), "nowhere: is not a complete map"),
        (("map", "fold"), "No such command 'fold'"),
    ],
)
def test_mistakes_are_sentences(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    answer = run(*words)
    assert answer.code == 2
    assert message in answer.err
    assert not list(tmp_path.iterdir())


def test_a_base_is_placed(run: Run, tmp_path: Path) -> None:
    robot = jacokin.load_robot()
    lines = ["x,y,z,qw,qx,qy,qz"]
    for q in robot.sample(np.random.default_rng(2), 10):
        pose = jacokin.pose([0.5, 0.5, 0.2]) * robot.forward_kinematics(q)
        lines.append(",".join(repr(float(value)) for value in (*pose.translation, *quat_wxyz(pose.rotation))))
    (tmp_path / "targets.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    answer = run("place", "--targets", str(tmp_path / "targets.csv"), "--json")
    assert answer.code == 0
    assert answer.document["places"][0]["reached"] == 10
