"""`jacokin teleop`: made and recorded hands, the keys of a terminal, a task's simulation, and what is refused."""

from __future__ import annotations

import json
import os
import pty
import signal
import sys
import termios
import threading
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from jacokin import Robot
from jacokin.motion import Trajectory
from jacokin.teleop import make_stream
from tests.cli.run import Answer, Run, running
from tests.robot_files import CRANE


def test_a_recorded_hand_leads_the_arm_to_where_it_ends(robot: Robot, run: Run, tmp_path: Path) -> None:
    stream = make_stream(robot, "smooth", np.random.default_rng(3))
    stream.save(tmp_path / "hand.npz")
    out = tmp_path / "motion.csv"
    words = ("teleop", "--stream", str(tmp_path / "hand.npz"), "--fast", "--output", str(out))
    answer = run(*words, "--json")
    motion = Trajectory.load(out)
    home, tool = (robot.forward_kinematics(q).translation for q in (robot.home, motion.q[-1]))
    np.testing.assert_allclose(tool - home, stream.hand[-1, :3] - stream.hand[0, :3], atol=1e-3)
    assert all(robot.within_limits(q) for q in motion.q)
    assert (np.abs(np.diff(motion.v, axis=0)) <= 4.0 * 0.01 + 1e-9).all()
    assert answer.document["q_end"] == motion.q[-1].tolist()
    assert answer.document["within_limits"]
    shown = run(*words).out
    assert "tool off target" in shown
    assert "kept in every tick" in shown


def test_a_hand_that_is_never_caught_up_with_ends_with_one(run: Run) -> None:
    answer = run("teleop", "--stream", "out_of_reach", "--fast", "--seconds", "7", "--scale", "3", code=1)
    assert "held back by" in answer.out


@pytest.mark.parametrize("name", ["gen3", "gen3_lite"])
def test_other_arms_are_led(run: Run, name: str) -> None:
    answer = run("teleop", "--robot", name, "--stream", "smooth", "--fast", "--seconds", "1")
    assert "kept in every tick" in answer.out


def test_an_arm_without_shapes_is_led_and_that_is_said(run: Run, tmp_path: Path) -> None:
    (tmp_path / "crane.urdf").write_text(CRANE, encoding="utf-8")
    words = ("teleop", "--robot", str(tmp_path / "crane.urdf"), "--fast", "--seconds", "0.5")
    answer = run(*words, code=(0, 1))
    assert answer.err == "jacokin: note: the description has no collision shapes: contact is not looked for\n"
    assert "limits            kept in every tick" in answer.out
    assert "no distance can be measured" in run(*words, "--clearance", "0.01", code=2).err


def test_a_task_gives_its_reward(run: Run) -> None:
    answer = run("teleop", "--task", "reach_site", "--fast", "--seconds", "1", "--json")
    assert answer.document["return"] >= 0.0
    assert answer.document["solved"] in (False, True)
    assert answer.document["ticks"] >= 25
    assert answer.document["lag"] < 0.05


@pytest.mark.slow
def test_the_command_is_one_that_the_motors_of_a_task_can_follow(run: Run) -> None:
    """Those of the wrist, whose rotors weigh 2 kg m^2, take 2.9 rad/s^2: at 4 they fall behind."""
    words = ("teleop", "--task", "lift_brick", "--stream", "jerky", "--random-seed", "2", "--fast", "--json")
    assert run(*words).document["lag"] < 0.03
    assert run(*words, "--acceleration-limit", "4").document["lag"] > 0.04  # as it was asked for


def test_fingers_close_in_a_task(monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    from jacokin.tasks import TaskEnv
    from jacokin.teleop import Player

    angles = list[float]()
    stepped = TaskEnv.step

    def step(self: TaskEnv, action: list[float]) -> object:
        angles.append(float(action[-1]))
        return stepped(self, np.asarray(action))

    monkeypatch.setattr(TaskEnv, "step", step)
    monkeypatch.setattr(Player, "fingers", 1.0, raising=False)
    run("teleop", "--task", "reach_site", "--fast", "--seconds", "1", "--json")
    assert np.allclose(np.diff(angles[:10]), 0.8 * 0.04)
    assert angles[-1] < 1.35 + 1e-9


@pytest.mark.slow
def test_a_page_leads_the_arm(robot: Robot) -> None:
    with running("teleop", "--device", "page", "--port", "0", "--json") as process:
        assert process.stderr is not None
        address, rest = process.stderr.readline().split(maxsplit=1)
        assert rest == "shows j2n6s300; Ctrl-C ends it\n"
        report, began = address.replace("/?", "/hand?"), time.monotonic()
        for keys in ["r"] * 30 + ["space"] * 10:
            with urllib.request.urlopen(f"{report}&keys={keys}", timeout=60.0) as answer:
                assert answer.status == 200
            time.sleep(0.03)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60.0)
        spent = time.monotonic() - began
    assert (process.returncode, err) == (0, "")
    found = json.loads(out)
    tools = [robot.forward_kinematics(q).translation for q in (robot.home, found["q_end"])]
    assert 0.01 < tools[1][2] - tools[0][2] < spent * 0.1  # no faster than the keys' 0.1 m/s
    assert found["statuses"]["HOLDING"] > 0  # the space bar opened the clutch


@pytest.mark.slow
def test_ctrl_c_brakes_the_arm_and_then_says_what_happened() -> None:
    with running("teleop", "--stream", "smooth", "--view", "--port", "0", "--json") as process:
        assert process.stderr is not None
        process.stderr.readline()  # the address
        time.sleep(3.0)
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=60.0)
    found = json.loads(out)
    assert found["duration"] < 10.0  # of 12
    assert found["statuses"]["HOLDING"] > 0
    assert found["within_limits"]


@pytest.mark.slow
def test_a_recording_is_shown_in_the_browser(run: Run) -> None:
    said = run("teleop", "--fast", "--seconds", "1", "--view", "--port", "0", "--json")
    assert said.err.startswith("http://127.0.0.1:")
    assert json.loads(said.out)["ticks"] >= 100


@pytest.mark.parametrize("task", ["lift_brick", "reach_site", "place_cradle"])
def test_the_props_of_a_task_are_drawn_where_they_are(task: str) -> None:
    import viser

    from jacokin.tasks import TaskEnv
    from jacokin.viewer.browser.stage import Props

    drawn = dict[str, SimpleNamespace]()

    class Scene:
        def __getattr__(self, kind: str) -> Callable[..., SimpleNamespace]:
            assert hasattr(viser.SceneApi, kind)

            def add(name: str, **look: Any) -> SimpleNamespace:
                assert name not in drawn
                made = drawn[name] = SimpleNamespace(kind=kind, **look)
                return made

            return add

    environment = TaskEnv(task, control="joint_position", flatten=False)
    environment.reset(seed=0)
    props = Props(SimpleNamespace(scene=Scene()), environment)  # type: ignore[arg-type]  # a stand-in
    model, data = environment.model, environment.data
    arm = model.body_rootid[model.jnt_bodyid[0]]
    frames = {int(name.split("/")[2]): one for name, one in drawn.items() if one.kind == "add_frame"}
    assert frames
    assert all(model.body_rootid[body] != arm for body in frames)
    offset = data.xpos[model.body_parentid[model.jnt_bodyid[0]]]
    for _ in range(2):
        for body, frame in frames.items():
            np.testing.assert_allclose(frame.position, data.xpos[body] - offset, atol=1e-9)
        environment.reset(seed=1)
        time.sleep(0.05)
        props.show()
    assert not any("ground" in name for name in drawn)
    environment.close()


def at_a_terminal(monkeypatch: pytest.MonkeyPatch, keys: list[bytes], act: Callable[[], Answer]) -> Answer:
    """What a command says while keys are typed, some 30 a second."""
    ours, theirs = pty.openpty()

    def type_keys() -> None:
        until = time.monotonic() + 60.0  # [s]
        while termios.tcgetattr(ours)[3] & termios.ICANON and time.monotonic() < until:
            time.sleep(0.01)  # what is typed before the program listens is lost
        for key in keys:
            time.sleep(0.03)
            os.write(ours, key)

    with os.fdopen(theirs, "r") as terminal:
        monkeypatch.setattr(sys, "stdin", terminal)
        typist = threading.Thread(target=type_keys)
        typist.start()
        answer = act()
        typist.join()
    os.close(ours)
    return answer


def test_keys_of_a_terminal_move_the_arm(robot: Robot, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    keys = [b"\x1b[A", b"\x1bOB", b"\x1b[3~", *[b"w"] * 10, *[b"W"] * 10, b" ", b"Q"]  # arrows do nothing
    words = ("teleop", "--device", "keyboard", "--seconds", "5", "--json")
    found = at_a_terminal(monkeypatch, keys, lambda: run(*words)).document
    tools = [robot.forward_kinematics(q).translation for q in (robot.home, found["q_end"])]
    assert found["duration"] < 4.0
    assert 0.005 < tools[1][0] - tools[0][0] < 0.06
    assert found["statuses"]["HOLDING"] > 0


@pytest.mark.slow
def test_keys_record_demonstrations(run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    path = tmp_path / "demos.lerobot"
    pause = [b"-"] * 10  # which does nothing
    keys = [*pause, b"b", *[b"w"] * 20, b"e", *pause, b"y", *pause, b"b", *[b"s"] * 15, b"x", *pause]
    words = ("teleop", "--device", "keyboard", "--task", "reach_site", "--record", str(path), "--json")
    answer = at_a_terminal(monkeypatch, [*keys, b"b", *[b"a"] * 15, b"y", *pause, b"q"], lambda: run(*words))
    assert {name: answer.document[name] for name in ("kept", "discarded", "is_written")} == {
        "kept": 2,
        "discarded": 1,
        "is_written": True,
    }
    assert "b begins it" in answer.err
    assert run("task", "replay", path).out.splitlines()[-1] == "2 of 2 equal bit by bit"


@pytest.mark.slow
def test_a_recorded_hand_demonstrates(run: Run, tmp_path: Path) -> None:
    path = str(tmp_path / "demos.hdf5")
    words = ("teleop", "--task", "reach_site", "--stream", "smooth", "--fast", "--record", path)
    assert "2 kept" in run(*words, "--episodes", "2", "--random-seed", "4").out
    assert run("task", "replay", path).out.startswith("episode 1, seed 4: equal\nepisode 2, seed 5: equal")
    assert "is there already" in run(*words, code=2).err


def test_joints_are_as_slow_as_wished(run: Run, tmp_path: Path) -> None:
    out = tmp_path / "motion.csv"
    run("teleop", "--stream", "jerky", "--fast", "--seconds", "6", "--velocity-limit", "0.1", "--output", out, code=1)
    motion = Trajectory.load(out)
    assert 0.09 < np.abs(motion.v).max() <= 0.1 + 1e-9


@pytest.mark.slow
def test_seconds_count_from_when_somebody_has_opened_the_page() -> None:
    with running("teleop", "--device", "page", "--port", "0", "--seconds", "1", "--json") as process:
        assert process.stderr is not None
        address = process.stderr.readline().split()[0]
        time.sleep(2.0)
        assert process.poll() is None
        with urllib.request.urlopen(f"{address.replace('/?', '/hand?')}&keys=", timeout=60.0):
            pass
        out, _ = process.communicate(timeout=60.0)
    assert 0.9 < json.loads(out)["duration"] < 1.5


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--stream", "jery"), "Did you mean 'jerky'"),
        (("--stream", "hand.csv"), "--stream must be a recording, .npz, or one of smooth, jerky"),
        (("--stream", "missing.npz"), "missing.npz: cannot be read: No such file"),
        (("--device", "keyboard", "--fast"), "--stream and --fast are for --device player"),
        (("--device", "keyboard"), "--device keyboard needs a terminal"),
        (("--device", "glove"), "'glove' is not one of"),
        (("--output", "motion.txt"), "--output must end in"),
        (("--seconds", "0"), "--seconds must be"),
        (("--stream", ""), "--stream: unknown kind ''"),
        (("--rate", "1e9"), "--rate must be at most 10000 [1/s]"),
        (("--filter", "-1"), "--filter must be"),
        (("--task", "reach_sight"), "reach_site"),
        (("--task", "reach_site", "--dt", "0.01"), "--task has its robot"),
        (("--task", "reach_site", "--robot", "j2s7s300"), "--task has its robot"),
        (("--acceleration-limit", "-1"), "--acceleration-limit must be"),
        (("--view", "--port", "70000"), "--port must be"),
        (("--output", "demos.lerobot"), "a data set of a task is --record demos.lerobot --task NAME"),
        (("--record", "demos.lerobot"), "--record goes with --task"),
        (("--task", "lift_brick", "--record", "demos.csv"), "--record must end in .hdf5, .minari, .lerobot"),
        (("--task", "lift_brick", "--record", "d.hdf5", "--seconds", "3"), "--record does not go with --seconds"),
        (("--task", "lift_brick", "--record", "no/d.hdf5"), "there is no folder"),
        (("--task", "lift_brick", "--record", "d.hdf5", "--camera", "wrst"), "Did you mean 'wrist'"),
        (("--task", "lift_brick", "--record", "d.hdf5", "--camera", "wrist=96"), "--camera must be NAME or"),
        (("--task", "lift_brick", "--record", "d.hdf5", "--episodes", "0"), "'--episodes': 0 is not in the range"),
        (("--task", "lift_brick", "--record", "d.hdf5", "--device", "keyboard"), "--device keyboard needs a terminal"),
        (("--camera", "wrist"), "--camera goes with --record"),
        (("--velocity-limit", "1", "2"), "--velocity-limit must be one number or 6, got 2"),
        (("--velocity-limit", "0"), "--velocity-limit must be"),
        (("--render",), "--render goes with --task"),
    ],
)
def test_what_is_refused(run: Run, words: tuple[str, ...], message: str) -> None:
    answer = run("teleop", *words, code=2)
    assert message in " ".join(answer.err.split())
    assert "Traceback" not in answer.err
