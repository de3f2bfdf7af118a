"""`benchmarks.corpus`: what becomes of descriptions in a folder."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from benchmarks import corpus
from tests.robot_files import SCENE, skeleton


def test_every_description_below_a_folder_has_a_row(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, text in {
        "maker/urdf/arm.urdf": skeleton("j1>l1 j2>l2 j3>l3 j4>l4 j5>l5 j6>l6 +tool0 gripper>jaw[0,1]"),
        "maker/urdf/cut.URDF": skeleton("j1>l1")[:-20],
        "maker/urdf/dog.urdf": skeleton("|a1>b1 |a2>b2 |a3>b3"),
        "mujoco/scene.xml": SCENE.replace('<include file="common.xml"/>', "").replace(' childclass="arm"', ""),
        "mujoco/part.xml": "<mujocoinclude/>",
        "notes.xml": "<package/>",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    rows = {row.file: row for row in (corpus.look(path, tmp_path, 3) for path in corpus.descriptions(tmp_path))}
    assert set(rows) == {"maker/urdf/arm.urdf", "maker/urdf/cut.URDF", "maker/urdf/dog.urdf", "mujoco/scene.xml"}
    arm = rows["maker/urdf/arm.urdf"]
    assert arm.robot is not None
    assert (arm.robot.joint_names[-1], arm.robot.default_frame, arm.structure) == ("j6", "tool0", "general")
    assert max(arm.mujoco, arm.other) < 1e-12
    assert (arm.found, arm.asked) == (3, 3)
    assert rows["maker/urdf/cut.URDF"].refused.startswith("not well-formed XML")
    assert not any(row.raw for row in rows.values())
    corpus.main([str(tmp_path), "--own", "1"])
    said = capsys.readouterr().out
    assert "4 files: 2 load, 0 raw exceptions; refused:" in said
    assert "several chains start at the base" in said
    assert "| maker | 3 | 1 | 0 | 1 | 1 | 1 of 1 |" in said
    assert "| all | 4 | 2 | 0 | 1 | 1 | 2 of 2 |" in said
    assert logging.getLogger("jacokin").isEnabledFor(logging.CRITICAL)  # silent for the time of the run only
