"""Recordings of ROS in the viewer: what was measured is played, what was commanded is drawn beside it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from jacokin import Robot
from jacokin.errors import InvalidInputError
from jacokin.logs import Log
from jacokin.viewer import serve
from jacokin.viewer.contents import Playback
from tests.cli.run import leave
from tests.logs.recordings import joint_angles, joint_state, names_of, write
from tests.viewer.page import opened, until

COMMAND = "/j2n6s300_driver/out/joint_command"
LEAD = np.array([0.0, 0.1, 0.0, 0.2, 0.0, 0.0])  # [rad] of the command
TIMES = np.arange(0.0, 2.0, 0.1)


@pytest.fixture
def path(robot: Robot, tmp_path: Path) -> Path:
    """A recording of an arm that moves behind its command, which begins half a second later."""
    q = robot.home + 0.1 * TIMES[:, None]
    rows = list(zip(TIMES, q, strict=True))
    said = [joint_state("/joint_states", float(t), names_of(robot).arm, row) for t, row in rows]
    return write(tmp_path, ".mcap", [*said, *(joint_angles(COMMAND, float(t), row + LEAD) for t, row in rows[5:])])


def test_what_was_measured_is_played_beside_what_was_commanded(path: Path, robot: Robot) -> None:
    for trajectory in (path, str(path), Log(path, robot).recording()):
        playback = Playback(trajectory, robot)
        assert playback.duration == pytest.approx(1.9)
        np.testing.assert_allclose(playback.at(1.0), robot.home + 0.1, atol=1e-9)
        assert playback.commanded_at(0.3) is None
        commanded = playback.commanded_at(1.0)
        assert commanded is not None
        np.testing.assert_allclose(commanded, robot.home + 0.1 + LEAD, atol=1e-6)


def test_without_commands_only_the_arm_is_played(path: Path, robot: Robot, tmp_path: Path) -> None:
    alone = write(tmp_path / "alone", ".bag", [joint_state("/joint_states", 0.0, names_of(robot).arm, robot.home)])
    assert Playback(alone, robot).commanded_at(0.0) is None
    with serve(robot, trajectory=alone, port=0) as viewer, opened(viewer) as page:
        assert viewer.view.commanded is None
        assert not page.has("Commanded")


@pytest.mark.slow
def test_the_command_is_a_ghost_until_the_arm_goes_elsewhere(path: Path, robot: Robot) -> None:
    data = robot.pin_model.createData()
    with serve(robot, trajectory=path, port=0) as viewer, opened(viewer) as page:
        assert page.ghosts == 0
        page.change("Time [s]", 1.0)
        assert until(lambda: page.ghosts == 1)
        assert "joint_4 is 11.46 deg from the command" in viewer.view.note
        commanded = viewer.view.commanded
        assert commanded is not None
        pin.forwardKinematics(robot.pin_model, data, commanded.copy())
        for joint in (4, 5, 6):
            drawn = page.screen.nodes[f"/ghosts/{joint}"].positions[-1]
            np.testing.assert_allclose(drawn, data.oMi[joint].translation, atol=1e-5)
        page.change("Commanded", False)
        assert until(lambda: page.ghosts == 0)
        page.change("Commanded", True)
        assert until(lambda: page.ghosts == 1)
        page.move_gizmo((0.3, -0.2, 0.5))
        assert until(lambda: viewer.view.commanded is None and page.ghosts == 0)


def test_a_recording_of_another_arm_is_refused(path: Path, robot: Robot, tmp_path: Path) -> None:
    other = write(tmp_path / "other", ".mcap", [joint_state("/joint_states", 0.0, ["a", "b"], [0.0, 1.0])])
    with pytest.raises(InvalidInputError, match="does not have the joints of j2n6s300: the joints a, b"):
        serve(robot, trajectory=other, port=0)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--log", "none.mcap"], "none.mcap: cannot be read"),
        (["--log", "PATH", "--joints-topic", "/joints"], "unknown topic '/joints'"),
        (["--log", "PATH", "--commanded-topic", "/command"], "unknown topic '/command'"),
        (["--log", "PATH", "--joint-prefix", "left_"], "'left_' before their names"),
        (["--log", "PATH", "--trajectory", "PATH"], "--trajectory does not go with --log"),
        (["--joints-topic", "/joint_states"], "goes with --log"),
    ],
)
def test_wrong_options_are_one_sentence(
    words: list[str], message: str, path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert leave("view", "--port", "0", *(str(path) if word == "PATH" else word for word in words)) == 2
    assert message in capsys.readouterr().err


@pytest.mark.slow
def test_a_log_is_served_from_the_command_line(
    path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from jacokin.viewer import Viewer

    shown: list[Viewer] = []

    def interrupt(viewer: Viewer) -> None:
        shown.append(viewer)
        raise KeyboardInterrupt

    monkeypatch.setattr(Viewer, "wait", interrupt)
    topics = ["--joints-topic", "/joint_states", "--commanded-topic", COMMAND, "--joint-prefix", "j2n6s300_"]
    assert leave("view", "--port", "0", "--log", str(path), *topics) == 0
    assert "Trajectory at 0.00 of 1.90 s" in shown[0].view.note
    assert capsys.readouterr().err.endswith("closed\n")
