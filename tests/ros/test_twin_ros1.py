"""`jacokin twin --ros 1` at real clients: the sender as it is, Kinova's actions and services, and what goes wrong."""

from __future__ import annotations

import dataclasses
import json
import signal
import time
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.motion import Trajectory, move_joints
from tests.ros.nodes import Ros, at_work, away, finish, free_port

pytestmark = pytest.mark.slow
HERE = Path(__file__).parent / "ros1"
SUCCEEDED, ABORTED = 3, 4  # of actionlib_msgs/GoalStatus
CLOSE = 0.5  # [deg]
STANDS = 0.3  # [s] 0.2, and what lies between a signal and the last message that it lets through


@pytest.fixture(scope="module")
def motion(robot: Robot) -> Trajectory:
    return move_joints(robot, robot.home, robot.home + np.array([0.4, 0.1, -0.2, 0.5, 0.1, 0.6]), dt=0.01)


@pytest.fixture
def files(motion: Trajectory, tmp_path: Path) -> Path:
    motion.save(tmp_path / "m.kinova.json", joint_prefix="j2n6s300_", ros=1)
    motion.save(tmp_path / "m.kinova.csv")
    return tmp_path


@pytest.mark.parametrize(
    ("name", "faults"),
    # A goal that is late would be called aborted, as by kinova-ros: its joints do not stand when its time is over.
    [("m.kinova.csv", ""), ("m.kinova.csv", "lag=0.05"), ("m.kinova.json", "")],
)
def test_what_is_sent_ends_where_the_file_does(
    ros1: Ros, motion: Trajectory, files: Path, name: str, faults: str
) -> None:
    with ros1.twin("--ros", 1, "--faults", faults) as twin:
        status, output, errors = ros1.send(files / name)
        code, record, _ = twin.ends()
    assert status == 0, errors
    assert code == 128 + signal.SIGTERM
    assert away(record, motion) < CLOSE
    assert float(output.partition("arm ends ")[2].split()[0]) == pytest.approx(away(record, motion), abs=0.2)
    assert record["margin"] > 0.0
    assert record["speed"] < 1.0


def test_what_is_lost_is_missing_at_the_end(ros1: Ros, motion: Trajectory, files: Path) -> None:
    """Velocities are an open loop: the sender measures, and says so, by its exit code too."""
    with ros1.twin("--ros", 1, "--faults", "loss=0.1", "--random-seed", 4) as twin:
        status, _, errors = ros1.send(files / "m.kinova.csv")
        _, record, _ = twin.ends()
    assert record["lost"] > 5
    assert away(record, motion) > CLOSE
    assert status == 1
    assert "not there" in errors
    assert float(errors.partition("arm ends ")[2].split()[0]) == pytest.approx(away(record, motion), abs=0.2)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_a_sender_that_ends_leaves_the_arm_standing(ros1: Ros, files: Path, number: signal.Signals) -> None:
    with ros1.twin("--ros", 1) as twin, at_work(ros1.sending(files / "m.kinova.csv")) as sender:
        twin.says("velocities come")
        time.sleep(0.8)
        sender.send_signal(number)
        finish(sender)
        time.sleep(1.0)
        _, record, _ = twin.ends()
    assert 20 < record["velocities"] < 160
    assert record["coasted"] < STANDS


def test_a_goal_that_is_cancelled_kills_the_twin_as_it_does_the_driver(ros1: Ros, files: Path) -> None:
    with ros1.twin("--ros", 1) as twin, at_work(ros1.sending(files / "m.kinova.json")) as sender:
        twin.says("a trajectory of")
        time.sleep(0.8)
        sender.send_signal(signal.SIGINT)
        _, _, said = finish(sender)
        status, record, errors = twin.ends(by_itself=True)
    assert "dies of a cancelled goal" in said
    assert status == 1
    assert "issue 191" in errors
    assert record["goals"] == 1
    assert record["coasted"] < STANDS


def test_services_actions_and_cartesian_velocities(ros1: Ros) -> None:
    with ros1.twin("--ros", 1) as twin:
        status, output, errors = ros1.run(HERE / "client.py")
        assert status == 0, errors
        _, twins, _ = twin.ends()
    record = json.loads(output.splitlines()[-1])
    assert record["rate"] == pytest.approx(10.0, rel=0.05)
    home = np.degrees(jacokin.load_robot().home)
    fingers = [f"j2n6s300_joint_finger{tip}_{k}" for tip in ("", "_tip") for k in (1, 2, 3)]
    assert record["state"]["name"] == [f"j2n6s300_joint_{k}" for k in range(1, 7)] + fingers
    np.testing.assert_allclose(record["state"]["angles"], home, atol=0.01)
    np.testing.assert_allclose(np.degrees(record["state"]["position"][:6]), home, atol=0.01)
    assert record["joints"] == record["pose"] == record["fingers"] == SUCCEEDED
    assert record["joints_off"] < CLOSE
    assert record["lengths"] == 3 * [len(record["state"]["name"])]  # as robot_state_publisher wants them
    assert record["led_off"][0] < 0.001  # [m] between what it leads the arm to, and what it measures
    assert record["led_off"][1] < 0.002  # [rad]
    assert record["pose_off"][0] < 0.005
    assert record["pose_off"][1] < 0.01
    assert record["pose_elsewhere"] == ABORTED  # as where tf knows no such frame
    assert record["finger"] == pytest.approx(4000.0, abs=70.0)
    assert 0.02 < record["rise"] < 0.06  # m; a sender that sleeps between messages is slower than 100 Hz
    assert record["closed"] > 6000.0
    assert 10.0 < record["turned"][5] < 21.0  # [deg] 20 at 100 Hz, and 0.9 to brake
    assert np.abs(record["turned"][:5]).max() < 0.2
    assert (record["stop"], record["stopped"], record["start"]) == ("Arm stopped", ABORTED, "Arm started")
    assert record["home"] == "KINOVA ARM HAS BEEN RETURNED HOME"
    np.testing.assert_allclose(record["angles"], home, atol=CLOSE)
    assert twins["margin"] > 0.0


def test_torques_forces_and_tools(ros1: Ros) -> None:
    with ros1.twin("--ros", 1) as twin:
        status, output, errors = ros1.run(HERE / "client.py", "pushes")
        assert status == 0, errors
        _, twins, _ = twin.ends()
    record = json.loads(output.splitlines()[-1])
    assert record["force"] < 1.0  # [N] nothing pushes
    assert np.abs(record["held"]).max() < 0.2  # torques are nothing where positions are held
    assert record["pushed"][5] > 5.0
    assert record["sunk"] < -0.02
    assert "does not simulate" in record["masses"]
    assert record["lined_up"] == pytest.approx(0.03, abs=2e-3)
    assert record["offset"][0] == pytest.approx(0.1, abs=2e-3)
    assert record["offset"][1] < 0.01
    assert record["no_offset"][0] < 2e-3
    assert record["forces"] == ["Start force control requested.", "Stop force control requested."]
    assert twins["margin"] > 0.0


def test_goals_that_come_while_others_end(ros1: Ros, tmp_path: Path) -> None:
    """The twin goes on: nobody waits for a lock that the other one holds."""
    script = tmp_path / "hurry.py"
    script.write_text(
        "import actionlib, os, random, rospy, time\n"
        "from jacokin.twin.ros1_messages import kinova_msgs\n"
        "messages = kinova_msgs()\n"
        "rospy.init_node('hurry', disable_signals=True)\n"
        "driver = '/j2n6s300_driver'\n"
        "kind = messages.ArmJointAnglesAction\n"
        "client = actionlib.SimpleActionClient(f'{driver}/joints_action/joint_angles', kind)\n"
        "assert client.wait_for_server(rospy.Duration(20.0))\n"
        "def here(): return rospy.wait_for_message(f'{driver}/out/joint_angles', messages.JointAngles, timeout=10.0)\n"
        "goal, chance = messages.ArmJointAnglesGoal(here()), random.Random(1)\n"
        "for count in range(300):\n"
        "    client.send_goal(goal)\n"
        "    if count % 3 == 0: client.cancel_all_goals()\n"
        "    time.sleep(chance.uniform(0.0, 0.03))\n"
        "client.send_goal(goal)\n"
        "assert client.wait_for_result(rospy.Duration(10.0))\n"
        "here()\n"
        "print(client.get_state(), flush=True)\n"
        "os._exit(0)\n"
    )
    with ros1.twin("--ros", 1):
        status, output, errors = ros1.run(script)
    assert status == 0, errors
    assert int(output.split()[-1]) == SUCCEEDED


def test_checksums_are_those_of_kinova_ros_and_control_msgs(ros1: Ros, tmp_path: Path) -> None:
    """Of commit 924781d of kinova-ros, and of control_msgs 1.5: other clients then find the same messages here."""
    script = tmp_path / "sums.py"
    script.write_text(
        "from jacokin.twin.ros1_messages import control_msgs, kinova_msgs\n"
        "import json\n"
        "print(json.dumps({name: each._md5sum for made in (kinova_msgs(), control_msgs())\n"
        "                  for name, each in vars(made).items()}))\n"
    )
    status, output, errors = ros1.run(script)
    assert status == 0, errors
    found = json.loads(output)
    known = {
        "JointVelocity": "bf16c4e5154848a0767d1aaab0a4796b",
        "JointAngles": "bf16c4e5154848a0767d1aaab0a4796b",
        "FingerPosition": "f56891e5dcd1900989f764a9b845c8e5",
        "KinovaPose": "e831d993faea563f6fe69d7db9b384c9",
        "PoseVelocity": "37cb696ff239fbcc6aa4a04f7318d9da",
        "PoseVelocityWithFingers": "2788ab35d01df923e0e72d7c730c2511",
        "PoseVelocityWithFingerVelocity": "d8789bad3911d8a482fde371a6b8abac",
        "HomeArm": "46e470f2c1a7177398c57a43eafe8d67",
        "Stop": "585dc4164508d473dff8f8b67a05d2ad",
        "Start": "e762e31d813526eaaa6a12e8354174fc",
        "ClearTrajectories": "c22f2a1ed8654a0b365f1bb3f7ff2c0f",
        "JointTorque": "bf16c4e5154848a0767d1aaab0a4796b",
        "CartesianForce": "b01974557c40b776cdb7003057779989",
        "ArmPoseAction": "31667e565fbf24e6a0900ee01cdf7272",
        "SetEndEffectorOffset": "7a5c04366489f137e01b31118dcce900",
        "SetTorqueControlMode": "891b541ef99af7889d0f22a062410be8",
        "ZeroTorques": "c22f2a1ed8654a0b365f1bb3f7ff2c0f",
        "AddPoseToCartesianTrajectory": "e831d993faea563f6fe69d7db9b384c9",
        "SetForceControlParams": "5c0999be3d1c60dba47ea0b2fd08231e",
        "SetNullSpaceModeState": "891b541ef99af7889d0f22a062410be8",
        "SetTorqueControlParameters": "c22f2a1ed8654a0b365f1bb3f7ff2c0f",
        "RunCOMParametersEstimation": "c22f2a1ed8654a0b365f1bb3f7ff2c0f",
        "FollowJointTrajectoryAction": "bc4f9b743838566551c0390c65f1a248",
        "FollowJointTrajectoryResult": "493383b18409bfb604b4e26c676401d2",
    }
    assert {name: found[name] for name in known} == known


def test_faster_than_real_time_it_gives_the_time(ros1: Ros, tmp_path: Path) -> None:
    script = tmp_path / "clock.py"
    script.write_text(
        "import rospy, time\n"
        "rospy.init_node('watch', disable_signals=True)\n"
        "while rospy.get_time() == 0.0: time.sleep(0.01)\n"
        "begun, simulated = time.monotonic(), rospy.get_time()\n"
        "time.sleep(1.0)\n"
        "print((rospy.get_time() - simulated) / (time.monotonic() - begun))\n"
    )
    with ros1.twin("--ros", 1, "--pace", 2):
        status, output, errors = ros1.run(script)
    assert status == 0, errors
    assert 1.2 < float(output) < 2.2


def test_as_fast_as_it_can(ros1: Ros, motion: Trajectory, files: Path) -> None:
    with ros1.twin("--ros", 1, "--fast") as twin:
        begun = time.monotonic()
        status, _, errors = ros1.send(files / "m.kinova.json")
        seconds = time.monotonic() - begun
        _, record, _ = twin.ends()
    assert status == 0, errors
    assert away(record, motion) < CLOSE
    assert record["time"] > 1.5 * seconds


def test_without_a_master_it_says_so(ros1: Ros) -> None:
    elsewhere = dict(ros1.environment) | {"ROS_MASTER_URI": f"http://127.0.0.1:{free_port()}"}
    status, _, errors = dataclasses.replace(ros1, environment=elsewhere).run("jacokin", "twin", "--ros", 1)
    assert status == 2
    assert "no ROS master at http://127.0.0.1" in errors
