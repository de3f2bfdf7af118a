"""ROS 1 of Debian, with a master, and ROS 2 of wheels; tests are skipped without."""

from __future__ import annotations

import os
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.ros.nodes import Ros, free_port, plain_environment

PYTHON = "/usr/bin/python3"  # of Debian, whose packages rospy and actionlib are
NEEDED = "python3-rospy python3-rosmaster python3-actionlib python3-{sensor,trajectory,geometry}-msgs"
HERE = Path(__file__).parent
ENVIRONMENT = Path(os.environ.get("ROS2_ENVIRONMENT", HERE.parents[1] / ".venv-ros2"))


def answers(port: int) -> bool:
    with socket.socket() as asking:
        return not asking.connect_ex(("127.0.0.1", port))


@pytest.fixture(scope="module")
def ros1() -> Iterator[Ros]:
    """ROS 1 with a master."""
    port = free_port()
    path = str(HERE / "ros1")
    environment = plain_environment(ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_IP="127.0.0.1", PYTHONPATH=path)
    needed = "import actionlib, genpy, geometry_msgs.msg, rosmaster, rospy, sensor_msgs.msg, trajectory_msgs.msg"
    try:
        subprocess.run([PYTHON, "-c", needed], env=environment, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip(f"ROS 1 is not installed: apt-get install {NEEDED}")
    command = [PYTHON, "-c", "import rosmaster; rosmaster.rosmaster_main()", "--core", "-p", str(port)]
    quiet = subprocess.DEVNULL
    master = subprocess.Popen(command, env=environment, stdout=quiet, stderr=quiet)
    try:
        end = time.monotonic() + 20.0
        while not answers(port) and time.monotonic() < end:
            time.sleep(0.05)
        yield Ros(PYTHON, environment)
    finally:
        master.kill()
        master.wait()


@pytest.fixture(scope="module")
def ros2() -> Ros:
    """ROS 2 in a domain of its own."""
    if not (ENVIRONMENT / "installed").exists():
        pytest.skip(f"ROS 2 is not installed: tests/ros/ros2/install.sh {ENVIRONMENT}")
    domain = str(1 + os.getpid() % 100)  # nobody else's
    environment = plain_environment(ROS_DOMAIN_ID=domain, ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST")
    return Ros(str(ENVIRONMENT / "bin" / "python"), environment)
