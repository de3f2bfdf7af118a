"""Recorded streams, and devices without the devices."""

from __future__ import annotations

import errno
import os
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import IO, Any

import numpy as np
import pytest

import jacokin
from jacokin import Robot, Tracker
from jacokin.errors import InvalidInputError, JacokinError, MissingExtraError, ModelError, UnknownNameError
from jacokin.teleop import Controller, Fingers, Keyboard, Player, SpaceMouse, Stream, Teleop, lead, make_stream
from jacokin.teleop.devices import twist_of_space_mouse
from jacokin.teleop.streams import KINDS
from tests import gripper_arms


@pytest.mark.one_quick
@pytest.mark.parametrize("kind", KINDS)
def test_streams_begin_and_end_at_the_tool_and_repeat(robot: Robot, kind: str) -> None:
    stream, again = (make_stream(robot, kind, np.random.default_rng(5)) for _ in range(2))
    assert np.array_equal(stream.time, again.time)
    assert np.array_equal(stream.hand, again.hand, equal_nan=True)
    assert (np.diff(stream.time) >= 0.0).all()
    home = robot.forward_kinematics(robot.home).translation
    for end in (stream.hand[0], stream.hand[-1]):
        assert np.allclose(end[:3], home, atol=1e-6)
    if kind == "dropouts":
        assert np.isnan(stream.hand).any()
        assert (np.abs(stream.hand[:, 3:]).sum(axis=1) == 0.0).any()
        assert np.diff(stream.time).max() > 0.1
    else:
        assert np.allclose(np.linalg.norm(stream.hand[:, 3:], axis=1), 1.0, atol=1e-9)
    away = np.linalg.norm(stream.hand[:, :3] - home, axis=1)
    assert np.nanmax(away) > 0.02


def test_shoulder_and_reach_are_what_they_say(robot: Robot) -> None:
    over = make_stream(robot, "shoulder", np.random.default_rng(0)).hand
    assert np.hypot(over[:, 0], over[:, 1]).min() < 0.03
    beyond = make_stream(robot, "out_of_reach", np.random.default_rng(0)).hand
    assert np.linalg.norm(beyond[:, :3] - [0.0, 0.0, 0.28], axis=1).max() > 0.85


def full_disk(file: IO[bytes]) -> None:
    file.write(b"PK")
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_stream_is_saved_and_read(robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stream = make_stream(robot, "dropouts", np.random.default_rng(1))
    stream.save(tmp_path / "hand.npz")
    read = Stream.load(tmp_path / "hand.npz")
    assert np.array_equal(read.time, stream.time)
    assert np.array_equal(read.hand, stream.hand, equal_nan=True)
    for path, match in (("hand.csv", "must end in .npz"), ("no/such/folder.npz", "cannot be written")):
        with pytest.raises(InvalidInputError, match=match):
            stream.save(tmp_path / path)
    (tmp_path / "text.npz").write_text("hello")
    whole = (tmp_path / "hand.npz").read_bytes()
    with monkeypatch.context() as full:
        full.setattr(np, "savez", lambda file, **_: full_disk(file))
        with pytest.raises(InvalidInputError, match="hand.npz: cannot be written: No space"):
            stream.save(tmp_path / "hand.npz")
    assert (tmp_path / "hand.npz").read_bytes() == whole
    (tmp_path / "half.npz").write_bytes(whole[: len(whole) // 2])
    with (tmp_path / "array.npz").open("wb") as file:
        np.save(file, np.zeros(3))
    np.savez(tmp_path / "other.npz", time=np.zeros(3), hand=np.zeros((3, 6)))
    np.savez(tmp_path / "lacking.npz", time=np.zeros(3))
    np.savez(tmp_path / "endless.npz", time=np.array([0.0, np.nan, 1.0]), hand=np.zeros((3, 7)))
    np.savez(tmp_path / "backwards.npz", time=np.array([2.0, 1.0, 0.0]), hand=np.zeros((3, 7)))
    names = ("text.npz", "half.npz", "array.npz", "other.npz", "lacking.npz", "endless.npz", "backwards.npz")
    for name in names:
        with pytest.raises(InvalidInputError, match="does not hold a stream"):
            Stream.load(tmp_path / name)
    with pytest.raises(InvalidInputError, match="cannot be read: No such file"):
        Stream.load(tmp_path / "missing.npz")


def test_a_player_says_the_newest_pose_once() -> None:
    hand = np.arange(21.0).reshape(3, 7)
    player = Player(Stream(np.array([0.0, 0.1, 0.11]), hand))
    assert player.read(-0.1) is None
    assert np.array_equal(np.asarray(player.read(0.05)), hand[0])
    assert player.read(0.06) is None
    assert np.array_equal(np.asarray(player.read(0.2)), hand[2])
    assert player.ended
    assert player.read(0.3) is None


def test_keys_are_twists_while_they_are_heard() -> None:
    keys = Keyboard(speed=0.1, turn=0.5)
    assert np.array_equal(keys.read(0.0), np.zeros(6))
    keys.press("w", 1.0)
    keys.press("o", 1.0)
    keys.press("?", 1.0)
    assert np.allclose(keys.read(1.1), [0.1, 0.0, 0.0, 0.0, 0.0, -0.5])
    keys.press("s", 1.1)
    assert np.allclose(keys.read(1.12)[0], 0.0)
    assert np.array_equal(keys.read(1.3), np.zeros(6))


def test_keys_close_and_open_the_fingers() -> None:
    keys = Keyboard()
    for key, fingers in (("g", 1.0), ("h", -1.0), ("w", 0.0)):
        keys = Keyboard()
        keys.press(key, 0.0)
        keys.read(0.1)
        assert keys.fingers == fingers
        keys.read(0.2)
        assert keys.fingers == 0.0
    hand = Fingers(0.5, lower=0.15, upper=1.35, speed=0.8)
    assert hand.move(1.0, 0.5) == pytest.approx(0.9)
    assert hand.move(-0.5, 0.5) == pytest.approx(0.7)
    assert hand.move(1.0, 10.0) == 1.35
    assert hand.move(-1.0, 10.0) == hand.angle == 0.15


def test_a_controller_says_each_report_once() -> None:
    """So that the watchdog hears when the reports end."""
    hand = Controller(speed=0.1, turn=0.5)
    assert hand.read(0.0) is None
    hand.report(keys={"w", "u", "g", "?"})
    assert np.allclose(np.asarray(hand.read(0.1)), [0.1, 0.0, 0.0, 0.0, 0.0, 0.5])
    assert hand.fingers == 1.0
    assert hand.read(0.11) is None
    hand.report()
    assert np.array_equal(np.asarray(hand.read(0.2)), np.zeros(6))
    assert hand.fingers == 0.0


def test_a_gamepad_moves_along_its_sticks_and_rests_in_their_middle() -> None:
    hand = Controller(speed=0.1, turn=0.5)
    for axes, buttons, twist, fingers in (
        ([0.0, -1.0, 0.0, 0.0], [], [0.1, 0.0, 0.0, 0.0, 0.0, 0.0], 0.0),  # away
        ([-1.0, 0.0, 0.0, 0.0], [], [0.0, 0.1, 0.0, 0.0, 0.0, 0.0], 0.0),  # to the left
        ([0.0, 0.0, -1.0, 0.0], [], [0.0, 0.0, 0.0, 0.0, 0.0, 0.5], 0.0),
        ([0.1, -0.1, 0.1, 0.1], [1.0], [0.0] * 6, 1.0),
        ([], [0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.5], [0.0, 0.0, 0.05, 0.0, 0.0, 0.0], -1.0),
        ([0.0, -9.0], [7.0], [0.1, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0),  # never faster
    ):
        hand.report(axes=axes, buttons=buttons)
        assert np.allclose(np.asarray(hand.read(0.0)), twist, atol=1e-12)
        assert hand.fingers == fingers


def test_holding_the_key_of_the_clutch_works_it_once() -> None:
    hand = Controller()
    for _ in range(5):
        hand.report(keys=["space"])
    assert [hand.toggled() for _ in range(3)] == [True, False, False]
    hand.report()
    hand.report(buttons=[0.0] * 9 + [1.0])
    hand.toggle()
    assert [hand.toggled() for _ in range(3)] == [True, True, False]


@pytest.mark.parametrize(
    ("report", "match"),
    [
        ({"axes": [np.nan]}, "axes must be at most 64 finite numbers"),
        ({"axes": np.zeros(65)}, "axes must be at most 64"),
        ({"buttons": [[0.0]]}, "buttons must be at most 64"),
        ({"buttons": ["left"]}, "buttons must be"),
        ({"axes": [[0.0], [0.0, 1.0]]}, "axes must be numbers"),
        ({"keys": 3}, "keys must be"),
        ({"keys": [["w"]]}, "keys must be"),
    ],
)
def test_malformed_reports_change_nothing(report: Any, match: str) -> None:
    hand = Controller()
    with pytest.raises(InvalidInputError, match=match):
        hand.report(**{"keys": ["w", "g", "space"], **report})
    assert hand.read(0.0) is None
    assert hand.fingers == 0.0
    assert not hand.toggled()


def test_wrong_fingers_are_refused() -> None:
    for angle, options, match in (
        (np.nan, {"lower": 0.0, "upper": 1.0}, "angle must be"),
        (0.0, {"lower": 2.0, "upper": 1.0}, "lower 2.0 must not be above upper 1.0"),
        (0.0, {"lower": 0.0, "upper": 1.0, "speed": 0.0}, "speed must be"),
    ):
        with pytest.raises(InvalidInputError, match=match):
            Fingers(angle, **options)  # type: ignore[arg-type]
    fingers = Fingers(0.5, lower=0.0, upper=1.0)
    for closing in (np.nan, "shut"):
        with pytest.raises(InvalidInputError, match="closing must be"):
            fingers.move(closing, 0.01)  # type: ignore[arg-type]
    assert fingers.angle == 0.5


def test_keys_that_are_none_are_refused() -> None:
    hand = Keyboard()
    for key, time, match in (("w", "now", "time must be"), ("w", np.nan, "time must be"), (3, 0.0, "key must be")):
        with pytest.raises(InvalidInputError, match=match):
            hand.press(key, time)  # type: ignore[arg-type]
    assert not hand.read(0.0).any()


def test_a_space_mouse_is_a_twist() -> None:
    state = SimpleNamespace(x=1.0, y=-0.5, z=0.0, pitch=0.1, roll=0.2, yaw=-1.0)
    twist = twist_of_space_mouse(state, np.repeat([0.1, 0.5], 3))
    assert np.allclose(twist, [0.1, -0.05, 0.0, 0.1, 0.05, -0.5])
    with pytest.raises(InvalidInputError, match="not what a space mouse says"):
        twist_of_space_mouse(SimpleNamespace(x=1.0), np.ones(6))


class FakeMouse:
    """What pyspacemouse 2.1 gives: a call reads one report, at most; unplugged, it stays connected and raises."""

    connected, closed, plugged = True, False, True

    def __init__(self) -> None:
        self.state = SimpleNamespace(t=-1.0, x=0.0, y=0.0, z=1.0, roll=0.0, pitch=0.0, yaw=0.0)
        self.waiting = list[dict[str, float]]()

    def read(self) -> SimpleNamespace:
        if not self.plugged:
            raise OSError("Failed to read from HID device: -1")
        if self.waiting:
            vars(self.state).update(t=self.state.t + 0.01, **self.waiting.pop(0))
        return self.state

    def close(self) -> None:
        self.closed = True
        if not self.plugged:
            raise OSError("gone")


def test_a_space_mouse_is_read_to_its_newest_report(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A mouse sends moves and turns one after the other, and both more often than an arm ticks."""
    fake = FakeMouse()

    def open_mouse(axis_convention: object) -> FakeMouse:
        print("SpaceNavigator found")
        return fake

    module = SimpleNamespace(open=open_mouse, AxisConvention=SimpleNamespace(HID_Z_UP="hid_z_up"))
    monkeypatch.setitem(sys.modules, "pyspacemouse", module)
    mouse = SpaceMouse(speed=0.1, turn=1.0)
    assert not capsys.readouterr().out  # of a program that may print JSON
    fake.waiting = [{"x": 0.5, "z": 0.0}, {"yaw": -0.5}, {"x": 1.0}]
    for time in (0.0, 0.01):  # the newest holds
        assert np.allclose(np.asarray(mouse.read(time)), [0.1, 0.0, 0.0, 0.0, 0.0, -0.5])
    fake.waiting = [{"x": 0.0}, {"yaw": 0.0}]
    assert np.allclose(np.asarray(mouse.read(0.02)), 0.0)


@pytest.mark.parametrize("says", [True, False])
def test_a_space_mouse_that_is_unplugged_says_nothing(monkeypatch: pytest.MonkeyPatch, says: bool) -> None:
    fake, asked = FakeMouse(), list[object]()

    def open_mouse(axis_convention: object) -> FakeMouse:
        asked.append(axis_convention)
        return fake

    def refuse(axis_convention: object) -> FakeMouse:
        raise RuntimeError("No connected or supported devices found.")

    module = SimpleNamespace(open=open_mouse, AxisConvention=SimpleNamespace(HID_Z_UP="hid_z_up"))
    monkeypatch.setitem(sys.modules, "pyspacemouse", module)
    with SpaceMouse(speed=0.2) as mouse:
        assert np.allclose(np.asarray(mouse.read(0.0)), [0.0, 0.0, 0.2, 0.0, 0.0, 0.0])
        gone = fake
        if says:
            fake.connected = False
        else:
            fake.plugged = False
        module.open = refuse
        assert mouse.read(0.1) is None
        assert gone.closed
        assert mouse.read(0.2) is None
        fake = FakeMouse()  # plugged in again
        module.open = open_mouse
        assert mouse.read(0.5) is None  # looked for once a second
        assert np.allclose(np.asarray(mouse.read(1.3)), [0.0, 0.0, 0.2, 0.0, 0.0, 0.0])
    assert fake.closed
    assert asked == ["hid_z_up"] * 2

    module.open = refuse
    with pytest.raises(JacokinError, match="no space mouse can be opened: No connected"):
        SpaceMouse()


def test_pyspacemouse_itself_reads_the_reports_of_a_mouse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bytes as a SpaceNavigator sends them, by USB's table: x to the right, y towards the hand, z down."""
    api = pytest.importorskip("pyspacemouse.api")

    class Navigator:
        """What easyhid gives."""

        vendor_id, product_id, product_string, manufacturer_string = 0x046D, 0xC626, "SpaceNavigator", "3Dconnexion"
        release_number, serial_number, path = 1, "", "/dev/hidraw0"
        is_there, waiting = True, list[bytearray]()

        def open(self) -> None:
            pass

        def set_nonblocking(self, is_on: bool) -> None:
            assert is_on

        def close(self) -> None:
            pass

        def read(self, size: int) -> bytearray:
            if not self.is_there:
                raise OSError("Failed to read from HID device: -1")
            return self.waiting.pop(0)[:size] if self.waiting else bytearray()

    hid = Navigator()
    monkeypatch.setattr(api, "Enumeration", lambda: SimpleNamespace(find=lambda: [hid] if hid.is_there else []))

    def report(channel: int, *numbers: int) -> bytearray:
        return bytearray([channel]) + b"".join(number.to_bytes(2, "little", signed=True) for number in numbers)

    with SpaceMouse(speed=0.1, turn=1.0) as mouse:
        assert mouse.read(0.0) is None  # nothing has come yet
        for number in range(20):
            hid.waiting += [report(1, 10 * number, 0, 0), report(2, 0, 0, 0)]
        hid.waiting += [report(1, 350, -175, -70), report(2, 35, -70, 105)]
        assert np.allclose(np.asarray(mouse.read(0.01)), [0.1, 0.05, 0.02, 0.1, 0.2, -0.3])
        hid.is_there = False
        assert mouse.read(0.02) is None
        hid.is_there = True
        hid.waiting += [report(1, 0, -350, 0)]
        assert np.allclose(np.asarray(mouse.read(1.5)), [0.0, 0.1, 0.0, 0.0, 0.0, 0.0])


def plug_in(monkeypatch: pytest.MonkeyPatch, mice: list[tuple[str, FakeMouse | Exception]]) -> None:
    """Names and interfaces, as the package lists them: a mouse has as many of both."""

    def open_mouse(axis_convention: object, device: str | None = None, device_index: int = 0) -> FakeMouse:
        those = [each for name, each in mice if device in (name, None)]
        if not those:
            raise RuntimeError("No connected or supported devices found.")
        found = those[device_index]
        if isinstance(found, Exception):
            raise found
        return found

    module = SimpleNamespace(
        open=open_mouse,
        get_connected_devices=lambda: [name for name, _ in mice],
        AxisConvention=SimpleNamespace(HID_Z_UP="hid_z_up"),
    )
    monkeypatch.setitem(sys.modules, "pyspacemouse", module)


def resting() -> FakeMouse:
    fake = FakeMouse()
    fake.state.z = 0.0
    return fake


def test_a_silent_first_interface_does_not_hide_the_mouse(monkeypatch: pytest.MonkeyPatch) -> None:
    silent, battery, cap = resting(), resting(), resting()
    plug_in(monkeypatch, [("SpaceMouse Pro", silent), ("SpaceMouse Pro", battery), ("SpaceMouse Pro", cap)])
    with SpaceMouse(speed=0.2) as mouse:
        battery.waiting = [{}]  # a report that says nothing of the cap
        assert mouse.read(0.0) is None
        cap.waiting = [{"x": 0.5}]
        assert np.allclose(np.asarray(mouse.read(0.1)), [0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
        assert (silent.closed, battery.closed, cap.closed) == (True, True, False)
        cap.waiting = [{"x": 0.0}]
        for tick in range(100):  # at rest it says so, for as long as it is
            assert np.allclose(np.asarray(mouse.read(1.0 + tick)), 0.0)
        assert mouse.trouble == ""
    assert cap.closed


def test_of_two_mice_the_one_that_is_moved_first_leads(monkeypatch: pytest.MonkeyPatch) -> None:
    one, other = resting(), resting()
    plug_in(monkeypatch, [("SpaceNavigator", one), ("SpaceMouse Compact", other)])
    mouse = SpaceMouse(speed=0.1)
    other.waiting = [{"y": 1.0}]
    assert np.allclose(np.asarray(mouse.read(0.0)), [0.0, 0.1, 0.0, 0.0, 0.0, 0.0])
    one.waiting = [{"x": 1.0}]
    assert np.allclose(np.asarray(mouse.read(0.1)), [0.0, 0.1, 0.0, 0.0, 0.0, 0.0])
    other.plugged = False
    assert mouse.read(0.2) is None
    other.plugged, one.plugged = False, True
    assert np.allclose(np.asarray(mouse.read(1.3)), [0.1, 0.0, 0.0, 0.0, 0.0, 0.0])  # what is there now


def test_a_mouse_that_says_nothing_says_why(monkeypatch: pytest.MonkeyPatch, robot: Robot) -> None:
    silent = resting()
    plug_in(monkeypatch, [("SpaceNavigator", silent)])
    mouse = SpaceMouse()
    assert mouse.read(0.0) is None
    assert mouse.trouble == ""
    assert mouse.read(6.0) is None
    assert mouse.trouble == "nothing has come from SpaceNavigator yet: push its cap, or plug it in anew"
    session = lead(Teleop(Tracker(robot, dt=0.1), clutch=True), SpaceMouse(), seconds=8.0, paced=False)
    assert list(session.faults) == [mouse.trouble]
    assert session.statuses == {"WAITING": 80}
    silent.plugged = False
    assert mouse.read(6.1) is None
    assert mouse.trouble == "the space mouse is unplugged"


@pytest.mark.parametrize("error", [RuntimeError("Failed to open device"), PermissionError(13, "Permission denied")])
def test_a_mouse_without_permission_says_how_to_give_it(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    plug_in(monkeypatch, [("SpaceNavigator", error)])
    with pytest.raises(JacokinError, match=r"SpaceNavigator is plugged in and cannot be opened .*udev rule"):
        SpaceMouse()
    plug_in(monkeypatch, [("SpaceNavigator", error), ("SpaceMouse Pro", FakeMouse())])
    assert SpaceMouse(speed=0.2).read(0.0) is not None  # the other one can
    plug_in(monkeypatch, [])
    with pytest.raises(JacokinError, match="no space mouse can be opened: No connected"):
        SpaceMouse()


def test_the_buttons_of_a_mouse_close_and_open_the_fingers(monkeypatch: pytest.MonkeyPatch) -> None:
    fake = resting()
    plug_in(monkeypatch, [("SpaceNavigator", fake)])
    mouse, fingers = SpaceMouse(), list[float]()
    for buttons in ([0, 0], [1, 0], [0, 1], [1, 1], [1]):
        vars(fake.state).update(buttons=buttons)
        mouse.read(0.0)
        fingers.append(mouse.fingers)
    assert fingers == [0.0, 1.0, -1.0, 0.0, 1.0]


def test_a_recording_plays_anew(robot: Robot) -> None:
    player = Player(make_stream(robot, "smooth", np.random.default_rng(0)))
    first = player.read(0.5)
    while not player.ended:
        player.read(100.0)
    player.reset(50.0)
    assert not player.ended
    assert player.read(49.9) is None
    np.testing.assert_array_equal(np.asarray(player.read(50.5)), np.asarray(first))


def test_without_its_package_a_space_mouse_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyspacemouse", None)
    with pytest.raises(MissingExtraError, match="spacemouse"):
        SpaceMouse()


@pytest.mark.parametrize(
    ("arguments", "error", "match"),
    [
        (("jery", np.random.default_rng()), UnknownNameError, "Did you mean 'jerky'"),
        (("smooth", 3), InvalidInputError, "rng"),
    ],
)
def test_wrong_streams_are_refused(robot: Robot, arguments: Any, error: type[Exception], match: str) -> None:
    for time, hand, words in (
        (3.0, np.zeros((1, 7)), "time must be"),
        ([0.0, 1.0], np.zeros((2, 6)), r"hand \(n, 7\)"),
        ([0.0, np.nan], np.zeros((2, 7)), "time must be finite"),
        ([1.0, 0.0], np.zeros((2, 7)), "must not run backwards"),
        ("now", None, "time must be"),
    ):
        with pytest.raises(InvalidInputError, match=words):
            Stream(time, hand)  # type: ignore[arg-type]
    with pytest.raises(error, match=match):
        make_stream(robot, *arguments)
    with pytest.raises(InvalidInputError, match="rate must be"):
        make_stream(robot, "smooth", np.random.default_rng(), rate=0.0)


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("name", "opened", "shut"), [("panda", 0.04, 0.0), ("mimicking", 0.0, 0.78), ("so101", 1.05, -0.03)]
)
def test_the_fingers_of_other_arms(name: str, opened: float, shut: float, tmp_path: Path) -> None:
    """They are open at first, close towards the value at which the gripper is shut, and stop there."""
    hand = Fingers.of(gripper_arms.load(name, tmp_path))
    assert hand.angle == pytest.approx(opened, abs=0.1)
    for _ in range(200):
        hand.move(1.0, 0.01)
    assert hand.angle == pytest.approx(shut, abs=0.05)
    before = hand.angle
    hand.move(-0.5, 0.1)
    assert 0.0 < (hand.angle - before) / (opened - shut) < 0.1


def test_an_arm_without_fingers_has_none_to_move() -> None:
    with pytest.raises(ModelError, match="gen3_6dof has no gripper"):
        Fingers.of(jacokin.load_robot("gen3_6dof"))
