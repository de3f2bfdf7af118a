"""The command line: one pose, kinematics, robots, and what it says to wrong input."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import jacokin
from jacokin.cli import arguments
from jacokin.cli.main import main
from jacokin.model import bundled

POSE = ("--position", "0.3", "-0.2", "0.5", "--down")
HOME = ("4.8046852", "2.92482", "1.002", "4.2031852", "1.4458", "1.3233")
FAR = ("--position", "9", "9", "9", "--down")


@dataclass
class Answer:
    code: int
    out: str
    err: str

    @property
    def document(self) -> dict[str, Any]:
        document: dict[str, Any] = json.loads(self.out)
        return document


Run = Callable[..., Answer]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    def call(*words: str) -> Answer:
        with pytest.raises(SystemExit) as leaving:
            main(words)
        captured = capsys.readouterr()
        code = leaving.value.code
        assert code is None or isinstance(code, int)
        return Answer(code or 0, captured.out, captured.err)

    return call


# ------------------------------------------------------------------------------------------------ one pose


def test_ik_reaches_the_pose_and_its_joints_read_back_exactly(run: Run) -> None:
    answer = run("ik", *POSE, "--json")
    assert answer.code == 0
    assert answer.document["status"] == "OK"
    robot = jacokin.load_robot()
    q = np.array(answer.document["q"])
    assert robot.within_limits(q)
    error = robot.forward_kinematics(q).inverse() * jacokin.pose([0.3, -0.2, 0.5], down=True)
    assert np.linalg.norm(error.translation) < 1e-6
    assert np.linalg.norm(error.rotation - np.eye(3)) < 1e-6
    expected = jacokin.IKSolver(robot).solve(jacokin.pose([0.3, -0.2, 0.5], down=True))
    assert q.tolist() == expected.q.tolist()  # not one bit lost on the way


def test_ik_without_an_orientation_leaves_it_free(run: Run) -> None:
    answer = run("ik", "--position", "0.3", "-0.2", "0.5", "--json")
    assert answer.code == 0
    assert answer.document["method"] == "qp"
    position = jacokin.load_robot().forward_kinematics(answer.document["q"]).translation
    assert np.linalg.norm(position - [0.3, -0.2, 0.5]) < 1e-6


def test_ik_degrees_are_for_angles_in_and_out(run: Run) -> None:
    in_degrees = run("ik", *POSE[:4], "--rpy", "90", "0", "-30", "--degrees", "--json")
    in_radians = run("ik", *POSE[:4], "--rpy", "1.5707963267948966", "0", "-0.5235987755982988", "--json")
    assert in_degrees.document["angle_unit"] == "deg"
    assert np.allclose(np.radians(in_degrees.document["q"]), in_radians.document["q"], rtol=0.0, atol=1e-12)


def test_ik_takes_the_branch_nearest_to_the_seed(run: Run) -> None:
    every = run("ik", *POSE, "--all", "--json").document["branches"]
    legal = [branch["q"] for branch in every if branch["within_limits"]]
    assert len(legal) >= 2
    for q in legal:
        answer = run("ik", *POSE, "--seed", *(repr(angle) for angle in q), "--json")
        assert np.allclose(answer.document["q"], q, rtol=0.0, atol=1e-9)


def test_ik_all_shows_every_branch_with_its_margins(run: Run) -> None:
    answer = run("ik", *POSE, "--all", "--json")
    branches = answer.document["branches"]
    assert answer.code == 0
    assert len(branches) >= 2
    assert [branch["distance"] for branch in branches] == sorted(branch["distance"] for branch in branches)
    for branch in branches:
        margins = [margin for margin in branch["limit_margin"] if margin is not None]
        assert (min(margins) >= 0.0) == branch["within_limits"]
    table = run("ik", *POSE, "--all").out
    for name in jacokin.load_robot().joint_names:
        assert name in table


def test_ik_rejects_branches_that_touch(run: Run) -> None:
    branches = run("ik", *POSE, "--all", "--collision", "report", "--json").document["branches"]
    free = [branch["q"] for branch in branches if branch["within_limits"] and not branch["touching"]]
    answer = run("ik", *POSE, "--collision", "reject", "--json")
    assert (answer.code == 0) == bool(free)
    assert answer.document["touching"] == []


def test_ik_out_of_reach_says_why_and_leaves_with_1(run: Run) -> None:
    answer = run("ik", *FAR)
    assert answer.code == 1
    assert "UNREACHABLE" in answer.out
    assert "closest legal configuration" in answer.out
    document = run("ik", *FAR, "--json").document
    assert document["success"] is False
    assert document["position_error"] > 10.0
    assert jacokin.load_robot().within_limits(document["q"])


def test_ik_all_out_of_reach_leaves_with_1(run: Run) -> None:
    answer = run("ik", *FAR, "--all")
    assert answer.code == 1
    assert "UNREACHABLE" in answer.out


def test_ik_with_the_qp_and_a_random_seed_repeats(run: Run) -> None:
    words = ("ik", *POSE, "--method", "qp", "--qp-solver", "quadprog", "--random-seed", "7", "--json")
    first, second = run(*words).document, run(*words).document
    assert first["qp_solver"] == "quadprog"
    assert first["q"] == second["q"]


# --------------------------------------------------------------------------------------------- kinematics


def test_fk_agrees_with_python_and_takes_negative_angles(run: Run) -> None:
    q = [-1.2, 2.9, 1.0, -4.2, -0.5, 1.3]
    document = run("fk", *(str(angle) for angle in q), "--json").document
    pose = jacokin.load_robot().forward_kinematics(q)
    assert document["position"] == pose.translation.tolist()
    assert document["within_limits"] is True
    again = jacokin.pose(document["position"], document["quat_wxyz"])
    assert np.allclose(again.rotation, pose.rotation, rtol=0.0, atol=1e-15)
    again = jacokin.pose(document["position"], rpy=document["rpy"])
    assert np.allclose(again.rotation, pose.rotation, rtol=0.0, atol=1e-15)


def test_fk_of_the_documented_home_pose(run: Run) -> None:
    # Kinova's documentation: 275.0 167.4 57.4 241.0 82.7 75.5 deg; its driver: (0.2123, -0.2572, 0.5096) m.
    document = run("fk", "275.0", "167.4", "57.4", "241.0", "82.7", "75.5", "--degrees", "--json").document
    published = [0.212322831154, -0.257197618484, 0.509646713734]
    assert np.linalg.norm(np.array(document["position"]) - published) < 4e-3


def test_fk_says_which_joint_breaks_its_limits(run: Run) -> None:
    answer = run("fk", "0", "0", "3", "0", "0", "0")
    assert answer.code == 0
    assert "broken by joint_2" in answer.out


def test_jacobian_agrees_with_python(run: Run) -> None:
    words = ("jacobian", *HOME, "--frame", "gripsite", "--reference", "local", "--json")
    document = run(*words).document
    robot = jacokin.load_robot()
    q = [float(angle) for angle in HOME]
    assert document["jacobian"] == robot.jacobian(q, "gripsite", "local").tolist()
    assert document["manipulability"] == robot.manipulability(q, "gripsite")


# ------------------------------------------------------------------------------------------------- robots


@pytest.mark.parametrize("name", bundled.NAMES)
def test_info_of_each_bundled_robot(run: Run, name: str) -> None:
    document = run("info", name, "--json").document
    robot = jacokin.load_robot(name)
    assert [joint["name"] for joint in document["joints"]] == list(robot.joint_names)
    assert [frame["name"] for frame in document["frames"]] == list(robot.frames)
    assert document["home"] == robot.home.tolist()
    lower = [-np.inf if joint["lower"] is None else joint["lower"] for joint in document["joints"]]
    assert lower == robot.lower.tolist()
    assert all(joint["source"] in document["sources"] for joint in document["joints"])


def test_info_shows_datasheet_torques_beside_the_efforts(run: Run) -> None:
    joints = run("info", "--json").document["joints"]
    assert [joint["effort"] for joint in joints] == [40.0, 80.0, 40.0, 20.0, 20.0, 20.0]
    assert [joint["datasheet_torque"] for joint in joints] == [30.5, 30.5, 30.5, 6.8, 6.8, 6.8]
    table = run("info", "--degrees").out
    assert "47.000000" in table
    assert "313.000000" in table
    assert "datasheet" in table


def test_info_of_a_file_names_the_file_as_source(run: Run) -> None:
    path = bundled.urdf_folder() / "j2n6s300.urdf"
    document = run("info", str(path), "--json").document
    assert document["sources"] == {"file": str(path)}
    assert document["joints"][0]["datasheet_torque"] is None


def test_crosscheck_of_the_same_arm_passes(run: Run) -> None:
    answer = run("crosscheck", "--samples", "20", "--json")
    assert answer.code == 0
    assert answer.document["within_tolerance"] is True
    assert max(row["value"] for row in answer.document["deviations"]) < 1e-11


def test_crosscheck_of_different_arms_fails(run: Run) -> None:
    answer = run("crosscheck", "j2n6s300", "j2s6s300", "--samples", "5")
    assert answer.code == 1
    assert "DIFFERS" in answer.out


def test_crosscheck_tolerance_is_heeded(run: Run) -> None:
    assert run("crosscheck", "--samples", "5", "--tolerance", "0").code == 1
    assert run("crosscheck", "j2n6s300", "j2s6s300", "--samples", "5", "--tolerance", "100").code == 0


def test_crosscheck_with_frames_and_joints_by_name(run: Run) -> None:
    words = ["crosscheck", "j2n6s300", "j2n6s300", "--samples", "5", "--json"]
    answer = run(*words, "--joint", "joint_1=joint_1", "--frame", "end_effector=end_effector")
    frames = {row["frame"] for row in answer.document["deviations"]}
    assert frames == {"end_effector", None}


# ---------------------------------------------------------------------------------------------- wrong input


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("ik", "--down"), "--position"),
        (("ik", "--position", "0.3", "-0.2"), "--position"),
        (("ik", "--position", "nan", "0", "0"), "finite"),
        (("ik", "--position", "-inf", "0", "0"), "finite"),
        (("ik", *POSE, "--rpy", "0", "0", "0"), "at most one orientation"),
        (("ik", *POSE[:4], "--quat-wxyz", "1", "1", "0", "0"), "norm 1.41421"),
        (("ik", *POSE[:4], "--quat-wxyz", "0", "0", "0", "0"), "norm 0"),
        (("ik", *POSE[:4], "--all"), "orientation"),
        (("ik", *POSE, "--seed", "1", "2", "3"), "seed"),
        (("ik", *POSE, "--seed", "north"), "'north'"),
        (("ik", *POSE, "--seed", "--json"), "--seed"),
        (("ik", *POSE, "--seed", "1", "2", "3", "4", "5", "nan"), "finite"),
        (("ik", *POSE, "--frame", "gripsit"), "Did you mean 'gripsite'"),
        (("ik", *POSE, "--method", "magic"), "auto, closed_form, qp"),
        (("ik", *POSE, "--method", "qp", "--qp-solver", "dapq"), "Did you mean 'daqp'"),
        (("ik", *POSE, "--collision", "maybe"), "ignore, report, reject"),
        (("ik", *POSE, "--robot", "j2n6s30"), "Did you mean 'j2n6s300'"),
        (("ik", *POSE, "--robot", "nowhere.urdf"), "nowhere.urdf"),
        (("ik", *POSE, "--output", "a.csv"), "--targets"),
        (("ik", *POSE, "--random-seed", "-1"), "--random-seed"),
        (("ik", "--targets", "nowhere.csv"), "nowhere.csv"),
        (("ik", "--targets", "a.csv", *POSE[:4]), "--position"),
        (("ik", "--targets", "a.csv", "--degrees"), "--degrees"),
        (("fk", "1", "2", "3"), "shape (6,)"),
        (("fk", "a", "b"), "ANGLE"),
        (("fk", *HOME, "--base", "lnk_base"), "Did you mean 'link_base'"),
        (("jacobian", *HOME, "--reference", "globe"), "local_world_aligned"),
        (("info", "nobody"), "j2n6s300"),
        (("crosscheck", "--samples", "0"), "--samples"),
        (("crosscheck", "--joint", "a"), "A=B"),
        (("crosscheck", "--joint", "a=b"), "joint_1"),
        (("crosscheck", "--tolerance", "-1"), "--tolerance"),
        (("solve",), "solve"),
    ],
)
def test_wrong_input_is_one_sentence_and_exit_code_2(run: Run, words: tuple[str, ...], message: str) -> None:
    answer = run(*words)
    assert answer.code == 2
    assert message in answer.err
    assert "Traceback" not in answer.err
    assert answer.out == ""


def test_a_broken_description_is_one_sentence(run: Run, tmp_path: Path) -> None:
    path = tmp_path / "cut.urdf"
    path.write_text('<robot name="cut"><link', encoding="utf-8")
    answer = run("fk", *HOME, "--robot", str(path))
    assert answer.code == 2
    assert "cut.urdf" in answer.err
    assert len(answer.err.splitlines()) == 1


def test_a_mistake_of_our_own_is_no_traceback(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise KeyError("inner")

    monkeypatch.setattr(arguments, "load", fail)
    answer = run("info")
    assert answer.code == 2
    assert "internal error" in answer.err


# ---------------------------------------------------------------------------------------- arguments and help


@pytest.mark.parametrize(
    ("given", "prepared"),
    [
        (["fk", "-1.2", "3"], ["fk", " -1.2", " 3"]),
        (["--seed", "-1", "2e-3", "--json"], ["--seed", " -1 2e-3", "--json"]),
        (["--seed", "1 2 3", "4"], ["--seed", "1 2 3", " 4"]),
        (["--seed"], ["--seed", " "]),
        (["-h", "--frame", "-x"], ["-h", "--frame", "-x"]),
        (["--seed", "1", "--position", "-.5", "-inf"], ["--seed", " 1", "--position", " -.5", " -inf"]),
    ],
)
def test_numbers_are_never_taken_for_options(given: list[str], prepared: list[str]) -> None:
    assert arguments.prepared(given) == prepared


@pytest.mark.parametrize("command", ["", "ik", "fk", "jacobian", "info", "track", "crosscheck", "doctor", "warmup"])
def test_help_teaches_by_example(run: Run, command: str) -> None:
    answer = run(*command.split(), "--help")
    assert answer.code == 0
    assert f"  jacokin {command}".rstrip() in answer.out
    assert "Examples:" in answer.out


def test_the_version_is_that_of_the_package(run: Run) -> None:
    assert run("--version").out == f"jacokin {jacokin.__version__}\n"


def test_help_loads_nothing_heavy() -> None:
    program = (
        "import sys\n"
        "from jacokin.cli.main import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
        "print([m for m in ('numpy', 'pinocchio', 'mujoco', 'mink', 'numba', 'rich') if m in sys.modules])\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_the_package_runs_as_a_module() -> None:
    words = [sys.executable, "-m", "jacokin", "fk", *HOME, "--json"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout)["frame"] == "end_effector"
