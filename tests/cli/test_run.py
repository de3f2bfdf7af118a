"""`jacokin run` without ROS: on the simulated arm, by a hand, at a forwarder that misbehaves; and what is refused."""

from __future__ import annotations

import ast
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.motion import move_joints
from tests.cli.run import Run
from tests.gripper_arms import panda_text
from tests.robot_files import CRANE, load_text, urdf_text


@pytest.fixture
def file(robot: Robot, tmp_path: Path) -> Path:
    motion = move_joints(robot, robot.home, robot.home + np.array([0.2, 0.1, -0.1, 0.2, 0.1, 0.3]), dt=0.02)
    motion.save(tmp_path / "m.csv")
    return tmp_path / "m.csv"


def test_the_simulated_arm_plays_a_file(run: Run, file: Path) -> None:
    said = json.loads(run("run", file, "--twin", "--faults", "lag=0.02,loss=0.01", "--fingers", "1", "--json").out)
    assert said["status"] == "ARRIVED"
    assert said["away_deg"] < 0.5
    assert said["stands"]
    assert said["latency"] == said["measured_latency"] == pytest.approx(0.04, abs=0.01)
    answer = run("run", file, "--twin", "--faults", "stall=9", "--random-seed", "3", code=(0, 1))
    assert "ARRIVED" in answer.out or "SILENT: nothing said where the arm is" in answer.out


def test_metres_are_not_sent_as_degrees(run: Run, tmp_path: Path) -> None:
    crane = tmp_path / "crane.urdf"
    crane.write_text(CRANE, encoding="utf-8")
    move_joints(jacokin.load_robot(crane), [0.0, 0.2, 0.0], [0.1, 0.7, 0.4]).save(tmp_path / "m.csv")
    said = run("run", tmp_path / "m.csv", "--ros", "1", "--robot", crane, code=2).err
    assert "--ros 1 sends degrees to Kinova's driver, and slide of crane slides: use --ros 2" in said


def test_what_slides_is_not_told_in_degrees(run: Run, tmp_path: Path) -> None:
    crane = tmp_path / "crane.urdf"
    crane.write_text(CRANE, encoding="utf-8")
    start = [0.0, 0.2, 0.0]
    move_joints(jacokin.load_robot(crane), start, [0.1, 0.4, 0.1]).save(tmp_path / "m.csv")
    ideal = forwarder(tmp_path, TURNED, "say({'q': q, 'v': None, 'torques': None})", q=start)
    words = ("run", tmp_path / "m.csv", "--robot", crane, "--forwarder", ideal, "--latency", "0")
    document = run(*words, "--json").document
    assert document["away"] < 2e-3
    assert "away_deg" not in document
    assert "rad or m from the end of the motion" in run(*words).out


def test_a_latency_that_was_given_wrongly_is_said(run: Run, file: Path) -> None:
    late = ("run", str(file), "--twin", "--faults", "lag=0.1")
    wrong = run(*late, "--latency", "0.05")
    assert "latency    0.20 s measured, but 0.05 s given: leave out --latency, or give 0.20" in wrong.out
    for words in ((), ("--latency", "0.2")):
        assert "latency    0.20 s\n" in run(*late, *words).out


def test_the_simulated_arm_is_a_jaco_whatever_the_robot_is(run: Run, file: Path, tmp_path: Path) -> None:
    panda = load_text(tmp_path / "panda.urdf", panda_text())
    move_joints(panda, panda.home, panda.home + 0.1).save(tmp_path / "panda.csv")
    said = run("run", tmp_path / "panda.csv", "--robot", tmp_path / "panda.urdf", "--twin", code=2).err
    assert said == "jacokin: --twin moves a simulated j2n6s300 of 6 joints, and panda has 7\n"
    own = tmp_path / "own.urdf"
    own.write_text(urdf_text(), encoding="utf-8")
    assert (
        "note: --twin moves a simulated j2n6s300, whatever j2n6s300 is"
        in run("run", file, "--robot", own, "--twin").err
    )


def test_an_open_loop_is_told_apart(run: Run, file: Path) -> None:
    answer = run("run", file, "--twin", "--faults", "loss=0.3", "--gain", "0", "--lag", "60", code=1)
    assert "MISSED" in answer.out
    assert "from the end of the motion" in answer.out


#: What a forwarder does after it has heard the joints, and what `jacokin run` says of it.
FORWARDERS = {
    "the forwarder has left": "pass",
    "no line of it": "print('hello', flush=True); time.sleep(5)",  # it is killed, for it does not leave
    "ROS 2: no node": "print(json.dumps({'error': 'ROS 2: no node'}), flush=True)",  # and leaves, as the forwarder does
    "ROS 1: no master": "print(json.dumps({'error': 'ROS 1: no master'}), flush=True); sys.stdin.read()",
}


def forwarder(folder: Path, *lines: str, q: Sequence[float] | None = None) -> str:
    """The command of one that does this with the `fields` of each line; `q` are at first those, or home."""
    script = folder / "forwarder.py"
    program = [
        "import json, sys",
        f"q, heard = {list(q or jacokin.load_robot().home.tolist())}, []",
        "def say(fields): print(json.dumps(fields), flush=True)",
        "for line in sys.stdin:",
        *(
            "    " + line
            for line in ("fields = json.loads(line)", "if 'joints' in fields: say({'listens': True})", *lines)
        ),
    ]
    script.write_text("\n".join(program))
    return f"{sys.executable} {script}"


TURNED = "if 'v' in fields: q = [angle + 0.01 * v for angle, v in zip(q, fields['v'])]"  # for 10 ms


@pytest.mark.parametrize("why", FORWARDERS)
def test_a_forwarder_that_does_not_serve(run: Run, file: Path, tmp_path: Path, why: str) -> None:
    script = tmp_path / "forwarder.py"
    script.write_text(f"import json, sys, time\nsys.stdin.readline()\n{FORWARDERS[why]}\n")
    assert why in run("run", file, "--forwarder", f"{sys.executable} {script}", code=2).err


def test_joints_of_other_names_are_told(run: Run, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What never began has no status."""
    monkeypatch.setattr("jacokin.runner.links.PATIENCE", 0.5)
    other = forwarder(
        tmp_path, "say({'listens': True, 'missing': fields['joints'][:2], 'heard': ['arm_joint_1', 'arm_joint_2']})"
    )
    answer = run("run", file, "--forwarder", other, "--json", code=2)
    told = "joint states have arm_joint_1, arm_joint_2, and no j2n6s300_joint_1, j2n6s300_joint_2"
    assert f"no arm says where it is (waited 0.5 s): {told}" in answer.err
    assert answer.out == ""


@pytest.mark.parametrize("listens", [False, True])
def test_the_topic_at_which_nobody_is_is_told(
    run: Run, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, listens: bool
) -> None:
    monkeypatch.setattr("jacokin.runner.links.PATIENCE", 0.5)
    says = {"listens": listens, "velocities": "/commands", "states": "/joint_states"}
    answer = run("run", file, "--forwarder", forwarder(tmp_path, f"say({says})"), code=2)
    told = "says where it is (waited 0.5 s): nobody is at /joint_states"
    assert (told if listens else "listens to velocities (waited 0.5 s): nobody is at /commands") in answer.err


def test_a_forwarder_moves_an_ideal_arm(run: Run, file: Path, tmp_path: Path) -> None:
    """The lines as they are: joints first, velocities for 10 ms each, angles back."""
    ideal = forwarder(tmp_path, TURNED, "say({'q': q, 'v': None, 'torques': None})")
    answer = run("run", file, "--forwarder", ideal, "--latency", "0", "--json")
    assert json.loads(answer.out)["away_deg"] < 0.2


def test_joints_of_a_file_are_named_as_there(run: Run, tmp_path: Path) -> None:
    """Only Kinova's drivers put the name of the robot before them."""
    panda = load_text(tmp_path / "panda.urdf", panda_text())
    move_joints(panda, panda.home, panda.home + 0.1).save(tmp_path / "panda.csv")
    move_joints(jacokin.load_robot(), [1.0] * 6, [1.1] * 6).save(tmp_path / "jaco.csv")
    asked = tmp_path / "asked.json"
    script = tmp_path / "forwarder.py"
    script.write_text(f"import sys\nopen({str(asked)!r}, 'w').write(sys.stdin.readline())\n")
    own = ("run", tmp_path / "panda.csv", "--robot", tmp_path / "panda.urdf")
    for words, prefix, names in (
        (own, "", panda.joint_names),
        ((*own, "--name", "left"), "left_", panda.joint_names),
        (("run", tmp_path / "jaco.csv"), "j2n6s300_", jacokin.load_robot().joint_names),
    ):
        run(*words, "--forwarder", f"{sys.executable} {script}", code=2)
        assert json.loads(asked.read_text()) == {"joints": [prefix + name for name in names]}


def test_contact_without_torques_is_said_once(run: Run, file: Path, tmp_path: Path) -> None:
    numb = forwarder(tmp_path, TURNED, "say({'q': q, 'v': [0.0] * 6, 'torques': [float('nan')] * 6})")
    words = ("run", file, "--forwarder", numb)
    answer = run(*words, "--contact", "5")
    assert answer.err.count("--contact watches nothing: the arm has told no velocities and torques for 0.5 s") == 1
    assert "--contact" not in run(*words).err


def test_a_driver_that_ends_and_comes_back_is_not_moved_again(run: Run, file: Path, tmp_path: Path) -> None:
    restarted = forwarder(
        tmp_path,
        "heard += [fields['v']] if 'v' in fields else []",
        "if len(heard) == 32: say({'listens': False})",
        "if len(heard) == 40: say({'listens': True})",
        "if len(heard) > 40 and any(heard[-1]): open(sys.argv[0] + '.moved', 'w')",
        "say({'q': q})",
    )
    answer = run("run", file, "--forwarder", restarted, "--lag", "90", code=1)
    assert "LOST: the driver no longer listens to velocities" in answer.out
    assert "was restarted, in the middle" in answer.out
    assert not list(tmp_path.glob("*.moved"))


def test_the_forwarder_is_written_once_and_is_of_python_3_8(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "forwarder.py"
    run("run", "--write-forwarder", file)
    ast.parse(file.read_text(), feature_version=(3, 8))
    assert "jacokin." not in file.read_text().replace("jacokin.runner.forwarder", "")
    assert "is there already" in run("run", "--write-forwarder", file, code=2).err


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("--twin",), "a file, or --live"),
        (("m.csv", "--live", "--twin"), "a file, or --live"),
        (("m.csv",), "--ros, --forwarder and --twin"),
        (("m.csv", "--twin", "--ros", "1"), "--ros, --forwarder and --twin"),
        (("m.csv", "--ros", "1", "--faults", "lag=1"), "--faults goes with --twin"),
        (("m.csv", "--twin", "--faults", "delay"), "lag, loss, stall"),
        (("m.csv", "--twin", "--robot", "j2s7s300"), "j2s7s300"),
        (("m.csv", "--twin", "--fingers", "2"), "2"),
        (("m.csv", "--twin", "--lag", "-1"), "lag"),
        (("m.csv", "--forwarder", ""), "--forwarder is empty"),
        (("m.csv", "--forwarder", "ssh 'arm"), "--forwarder is no command: No closing quotation"),
        (("m.csv", "--forwarder", "/no/such/program"), "does not start"),
        (("none.csv", "--twin"), "none.csv"),
        (("m.txt", "--twin"), "must end in"),
    ],
)
def test_what_is_refused(
    run: Run, file: Path, words: tuple[str, ...], why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(file.parent)
    assert why in run("run", *words, code=2).err
