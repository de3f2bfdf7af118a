"""The commands of docs/real_arm.md at twins: each line of the page, with nothing changed but where programs are."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from jacokin.motion import Trajectory
from tests.docs.test_snippets import ROOT, blocks
from tests.ros.nodes import PYTHON, SENDER, Ros, Twin, at_work, finish, heed_signals

pytestmark = pytest.mark.slow
PAGE = ROOT / "docs" / "real_arm.md"
TEXT = "\n".join(code for _, code in blocks(PAGE, ("console",))).replace("\\\n", " ")
LINES: list[str] = [
    line for line in re.findall(r"^\$ (.*)$", TEXT, re.M) if re.search(r"--ros|--action|trajectory.py", line)
]
HAND = '{"clutch": true}\n{"hand": [0.0, 0.0, 0.05, 0.0, 0.0, 0.0]}\n{"end": true}\n'
CLOSE = 0.5  # [deg]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the Python of the page has saved its files."""
    found = tmp_path_factory.mktemp("page")
    code = "\n".join(text for _, text in blocks(PAGE, ("python",)))
    code = code.replace("from examples.drawing import draw", "draw = lambda *words, **more: None")
    for name in (
        "lift.json",
        "lift.csv",
        "lift.kinova.csv",
        "lift.kinova.json",
        "to_start.kinova.csv",
        "first.kinova.csv",
        "back.kinova.csv",
    ):
        assert name in code
    # The page saves lift.json for several controllers; the twin's joints have the name of its robot.
    code = code.replace('joint_prefix="arm_"', 'joint_prefix="j2n6s300_"').replace(", first_time=0.1", "")
    code = code.replace('path.save("lift.json")', 'path.save("lift.json", joint_prefix="j2n6s300_", first_time=0.1)')
    subprocess.run([sys.executable, "-P", "-c", code], cwd=found, check=True, env={"PYTHONPATH": str(ROOT)})
    subprocess.run(
        [sys.executable, "-P", "-m", "jacokin", "run", "--write-forwarder", "forwarder.py"], cwd=found, check=True
    )
    return found


def of_page(*parts: str) -> str:
    """The one line of the page that has these parts."""
    found = [line for line in LINES if all(part in line for part in parts)]
    assert len(found) == 1, (parts, found)
    return found[0]


def done(ros: Ros, line: str, folder: Path, hand: str = "") -> None:
    """Run a line of the page as it is, where its programs are."""
    words = shlex.split(line.rpartition("| ")[2].replace("ssh arm python3", PYTHON))
    if words[1].endswith("send_trajectory.py"):
        words[:2] = [ros.python, str(SENDER)]
    else:
        words[0] = sys.executable
        words += [] if "--forwarder" in words else ["--python", ros.python]
        words += ["--lag", "20", "--silence", "5"]  # a busy machine is late
    environment = {**ros.environment, "PYTHONPATH": f"{ros.environment.get('PYTHONPATH', '')}:{ROOT}"}
    pipe = subprocess.PIPE
    process = subprocess.Popen(
        words, cwd=folder, env=environment, stdin=pipe, stdout=pipe, stderr=pipe, text=True, preexec_fn=heed_signals
    )
    with at_work(process):
        assert process.stdin is not None
        process.stdin.write(hand)
        status, output, errors = finish(process)
    assert status == 0, f"{line}\n{output}{errors}"


def start(folder: Path) -> Sequence[object]:
    """Options of a twin whose arm stands where the path begins."""
    return ["--from", *Trajectory.load(folder / "lift.csv").q[0].tolist()]


def ends_there(twin: Twin, folder: Path) -> None:
    _, record, _ = twin.ends()
    end = Trajectory.load(folder / "lift.csv").q[-1]
    away = np.remainder(np.array(record["angles"]) - end + np.pi, 2.0 * np.pi) - np.pi
    assert np.degrees(np.abs(away).max()) < CLOSE


def test_all_lines_are_run() -> None:
    assert len(LINES) == 10, LINES  # each of which is in a test below


def test_the_twin_is_brought_to_the_start_and_lifts(ros1: Ros, folder: Path) -> None:
    twin = of_page("jacokin twin --ros 1").replace("--view", "")
    with ros1.twin(*shlex.split(twin)[4:]) as arm:
        done(ros1, of_page("run first.kinova.csv --ros 1"), folder)
        done(ros1, of_page("run back.kinova.csv --ros 1"), folder)
        done(ros1, of_page("run to_start.kinova.csv --ros 1"), folder)
        done(ros1, of_page("run lift.kinova.csv --ros 1"), folder)
        ends_there(arm, folder)


def test_a_forwarder_elsewhere(ros1: Ros, folder: Path) -> None:
    with ros1.twin("--ros", 1, *start(folder)) as twin:
        done(ros1, of_page("run lift.csv", "--forwarder"), folder)
        ends_there(twin, folder)


def test_a_hand(ros1: Ros, folder: Path) -> None:
    with ros1.twin("--ros", 1) as twin:
        done(ros1, of_page("--live"), folder, HAND)
        _, record, _ = twin.ends()
    assert record["velocities"] > 5


def test_a_goal_to_kinova_ros(ros1: Ros, folder: Path) -> None:
    with ros1.twin("--ros", 1, *start(folder)) as twin:
        done(ros1, of_page("send_trajectory.py lift.kinova.json"), folder)
        ends_there(twin, folder)


def test_ros2(ros2: Ros, folder: Path) -> None:
    with ros2.twin("--ros", 2, *start(folder)) as twin:
        done(ros2, of_page("run lift.csv --ros 2"), folder)
        ends_there(twin, folder)


def test_a_goal_to_ros2(ros2: Ros, folder: Path) -> None:
    line = of_page("send_trajectory.py lift.json").replace("/arm_controller/", "/joint_trajectory_controller/")
    with ros2.twin("--ros", 2, *start(folder)) as twin:
        done(ros2, line, folder)
        ends_there(twin, folder)
