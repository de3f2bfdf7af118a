"""`jacokin crosscheck`: whether two descriptions agree."""

from __future__ import annotations

from pathlib import Path

from jacokin.model.descriptions import bundled
from tests.cli.run import Run
from tests.robot_files import CRANE


def test_crosscheck_of_the_same_arm_passes(run: Run) -> None:
    answer = run("crosscheck", "--samples", "20", "--json")
    assert answer.document["within_tolerance"] is True
    assert max(row["value"] for row in answer.document["deviations"]) < 1e-11


def test_crosscheck_of_different_arms_fails(run: Run) -> None:
    assert "DIFFERS" in run("crosscheck", "j2n6s300", "j2s6s300", "--samples", "5", code=1).out


def test_crosscheck_tolerance_is_heeded(run: Run) -> None:
    run("crosscheck", "--samples", "5", "--tolerance", "0", code=1)
    run("crosscheck", "j2n6s300", "j2s6s300", "--samples", "5", "--tolerance", "100")


def test_crosscheck_with_frames_and_joints_by_name(run: Run) -> None:
    words = ["crosscheck", "j2n6s300", "j2n6s300", "--samples", "5", "--json"]
    answer = run(*words, "--joint", "joint_1=joint_1", "--frame", "end_effector=end_effector")
    frames = {row["frame"] for row in answer.document["deviations"]}
    assert frames == {"end_effector", None}


def test_crosscheck_with_bases_of_their_own(run: Run) -> None:
    urdf, mjcf = (str(bundled.urdf_folder() / f"j2n6s300.{ending}") for ending in ("urdf", "xml"))
    words = ("crosscheck", urdf, mjcf, "--samples", "5", "--base", "link_1", "--json")
    assert run(*words).document == run(*words, "--second-base", "link_1").document
    assert "'lnk'" in run(*words, "--second-base", "lnk", code=2).err


def test_crosscheck_says_which_arm_lacks_a_joint(run: Run, tmp_path: Path) -> None:
    other = tmp_path / "crane.urdf"
    other.write_text(CRANE, encoding="utf-8")
    assert "unknown joint of the second arm 'joint_1'" in run("crosscheck", "gen3", other, code=2).err
