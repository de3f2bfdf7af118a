"""The benchmark's own machinery: workers, referee, scores, tables. Nothing is installed and nothing is timed."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from jacokin import Robot

sys.path.append(str(Path(__file__).resolve().parents[2]))  # last: the installed package is what gets tested

from benchmarks import brute_force, comparison, environments, pose_files, report, run, targets
from benchmarks.environments import InstallError, Peer
from benchmarks.referee import apart
from benchmarks.worker import Worker, WorkerError

# A solver that knows one answer: home. It prints, as libraries do, and fails on request.
FAKE = """
import os
import sys
import numpy as np

class Peer:
    version = "fake 1.0"

    def __init__(self, setup):
        print("a library says hello on stdout")
        if setup["variant"] == "broken":
            raise RuntimeError("no such robot")
        self.home = np.array(setup["home"])

    def forward(self, q):
        print("and again")
        return np.eye(4) * q[0]

    def prepare(self, T):
        return T[:3, 3]

    def solve(self, position):
        if position[0] > 10.0:
            print("out of luck", file=sys.stderr)
            sys.stderr.flush()
            os._exit(3)
        if position[0] > 1.0:
            raise ValueError("too far")
        return position

    def answers(self, raw):
        return [self.home, self.home + raw[0]] if raw[0] >= 0.0 else []
"""
HOME = [0.1, 0.2, 0.1 + 0.2, 1e-17]


@pytest.fixture
def fake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[], Worker]:
    (tmp_path / "fake_peer.py").write_text(FAKE)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    return lambda: Worker(Path(sys.executable), "fake_peer")


def at(x: float) -> NDArray[np.float64]:
    pose = np.eye(4)
    pose[0, 3] = x
    return pose


def test_worker_answers_exactly_and_ignores_prints(fake: Callable[[], Worker]) -> None:
    with fake() as worker:
        assert worker.start({"home": HOME, "variant": ""}) == "fake 1.0"
        assert np.array_equal(worker.forward(np.array([[2.0, 0.0]]))[0], 2.0 * np.eye(4))
        answers, seconds = worker.solve(np.array([at(0.5), at(-1.0)]))
    assert np.array_equal(answers[0], np.add.outer([0.0, 0.5], HOME))
    assert answers[1].size == 0
    assert seconds.shape == (2, 2)
    assert (seconds[:, 0] > 0.0).all()


def test_worker_reports_errors_and_goes_on(fake: Callable[[], Worker]) -> None:
    with fake() as worker:
        with pytest.raises(WorkerError, match="RuntimeError: no such robot"):
            worker.start({"home": HOME, "variant": "broken"})
        worker.start({"home": HOME, "variant": ""})
        with pytest.raises(WorkerError, match="ValueError: too far"):
            worker.solve(np.array([at(2.0)]))
        assert len(worker.solve(np.array([at(0.0)]))[0]) == 1


def test_worker_that_dies_gives_its_last_words(fake: Callable[[], Worker]) -> None:
    with fake() as worker:
        worker.start({"home": HOME, "variant": ""})
        with pytest.raises(WorkerError, match="ended with code 3: out of luck"):
            worker.solve(np.array([at(20.0)]))
        with pytest.raises(WorkerError, match="ended with code 3"):
            worker.solve(np.array([at(0.0)]))


def test_peer_that_cannot_be_installed_is_in_the_table(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(peer: Peer) -> Path:
        raise InstallError(f"not installed: no wheel of {peer.packages[0]} for this Python")

    monkeypatch.setattr(comparison, "interpreter", refuse)
    wanted = targets.random_configurations(robot, np.random.default_rng(0), 3)
    section = run.peers_section(robot, [wanted], ["ssik"], 1)
    assert "| ssik `jaco2_ik.solve` | not measured |" in section.body
    assert "no wheel of ssik==8.2.0 for this Python" in section.body


def test_peer_with_another_robot_is_refused(
    robot: Robot, fake: Callable[[], Worker], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(comparison, "interpreter", lambda peer: Path(sys.executable))
    wanted = targets.random_configurations(robot, np.random.default_rng(0), 3)
    (contestant,) = comparison.run(robot, [Peer("fake", "fake", "fake_peer")], [wanted], 1)
    assert contestant.failure.startswith("its description differs by")
    assert contestant.worker is None


def test_failed_install_keeps_the_reason(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(environments, "FOLDER", tmp_path)
    monkeypatch.setattr(environments, "ROOT", tmp_path)
    (tmp_path / "peers" / "bin").mkdir(parents=True)
    pip = tmp_path / "peers" / "bin" / "python"
    pip.write_text("#!/bin/sh\necho 'WARNING: noise' >&2\necho 'ERROR: no matching distribution' >&2\nexit 1\n")
    pip.chmod(0o755)
    with pytest.raises(InstallError, match="not installed: ERROR: no matching distribution"):
        environments.interpreter(Peer("gone", "gone", "gone", ("gone==1.0",)))
    assert not (tmp_path / "peers" / "gone.installed").exists()
    pip.write_text("#!/bin/sh\nexit 0\n")
    assert environments.interpreter(Peer("gone", "gone", "gone", ("gone==1.0",))) == pip
    pip.write_text("#!/bin/sh\nexit 1\n")  # not asked again
    assert environments.interpreter(Peer("gone", "gone", "gone", ("gone==1.0",))) == pip


def test_every_peer_has_a_file_and_pinned_packages() -> None:
    folder = Path(environments.__file__).parent / "peers"
    for peer in environments.PEERS:
        assert (folder / f"{peer.module}.py").is_file()
        assert all("==" in package for package in peer.packages)
    assert len({peer.name for peer in environments.PEERS}) == len(environments.PEERS)


def test_referee_agrees_with_the_robot_and_counts_every_ulp(robot: Robot) -> None:
    referee = comparison.make_referee(robot)
    q = robot.sample(np.random.default_rng(1), 20)
    for row, pose in zip(q, referee.forward(q), strict=True):
        assert np.abs(robot.forward_kinematics(row).homogeneous - pose).max() < 1e-12
    assert np.array_equal(referee.limits[:, 0], robot.lower)
    assert np.array_equal(referee.limits[:, 1], robot.upper)
    edge = np.array([robot.home, robot.home])
    edge[0, 1] = robot.upper[1]
    edge[1, 1] = np.nextafter(robot.upper[1], np.inf)
    assert referee.within_limits(edge).tolist() == [True, False]


def test_referee_measures_small_and_large_turns(robot: Robot) -> None:
    referee = comparison.make_referee(robot)
    q = np.array([robot.home, robot.home, robot.home])
    q[1, 5] += 1e-9  # joint 6 turns the tool about its own axis, which passes through the end effector
    q[2, 5] += np.pi
    position, orientation = referee.errors(q, referee.forward(q[:1])[0])
    assert position.max() < 1e-15
    assert orientation == pytest.approx([0.0, 1e-9, np.pi], abs=1e-15)


def contestant(answers: list[NDArray[np.float64]], *, all_branches: bool = True) -> comparison.Contestant:
    done = comparison.Contestant(Peer("x", "x", "x", all_branches=all_branches))
    done.answers["set"] = answers
    done.seconds["set"] = [np.array([1e-3, 1e-4])] * (len(answers) - 1) + [np.array([1.0, 1e-4])]
    return done


def test_score_counts_what_the_referee_sees(robot: Robot) -> None:
    referee = comparison.make_referee(robot)
    q = robot.sample(np.random.default_rng(2), 4)
    wanted = targets.Targets("set", referee.forward(q), q)
    turned, off, beyond = q[1].copy(), q[2].copy(), q[3].copy()
    turned[0] += 2.0 * np.pi  # another copy of the same configuration
    off[5] += 1e-5  # ten times the tolerance
    beyond[1] += 2.0 * np.pi  # exact, and outside the limits
    # Two rounds of two: targets 0 and 2 come first, then 1 and 3.
    answers = [np.empty((0, 6)), off[None], np.array([q[1], turned]), beyond[None]]
    score = comparison.score(contestant(answers), wanted, 2, referee)
    assert score.solved == 0.25  # target 1 alone
    assert score.found == 0.75  # `off` and `beyond` too: neither limits nor tolerance matter there
    assert score.within_limits == 0.75
    assert score.branches == 1.0
    assert score.orientation == pytest.approx(1e-5)
    assert score.median == 1e-3
    assert score.p99 > 0.9
    assert score.processor_p99 == pytest.approx(1e-4)


def test_score_without_answers(robot: Robot) -> None:
    referee = comparison.make_referee(robot)
    q = robot.sample(np.random.default_rng(2), 2)
    wanted = targets.Targets("set", referee.forward(q), q)
    score = comparison.score(contestant([np.empty((0, 6))] * 2), wanted, 1, referee)
    assert (score.solved, score.found, score.branches) == (0.0, 0.0, 0.0)
    assert score.within_limits is score.position is score.orientation is None


@pytest.mark.parametrize("up", [False, True])
def test_vertical_targets_are_vertical_within_limits_and_reached(robot: Robot, up: bool) -> None:
    wanted = targets.vertical_tool(robot, np.random.default_rng(3), 10, up=up)
    for pose, q in zip(wanted.poses, wanted.generating, strict=True):
        assert np.array_equal(pose[:3, 2], [0.0, 0.0, 1.0 if up else -1.0])
        assert np.array_equal(pose[2, :2], [0.0, 0.0])
        assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0, abs=1e-15)
        assert robot.within_limits(q)
        assert np.abs(robot.forward_kinematics(q).homogeneous - pose).max() < 1e-12


def test_structured_targets_meet_their_conditions(robot: Robot) -> None:
    wanted = targets.structured(robot, np.random.default_rng(3), 9)
    assert np.abs(wanted.poses[0::3, :2, 2]).max() < 1e-12
    assert np.abs(wanted.poses[2::3, :2, 2]).max() < 1e-12
    model, data = robot.pin_model, robot.pin_model.createData()
    for index, (pose, q) in enumerate(zip(wanted.poses, wanted.generating, strict=True)):
        assert robot.within_limits(q)
        assert np.abs(robot.forward_kinematics(q).homogeneous - pose).max() < 1e-12
        if index % 3:
            pin.forwardKinematics(model, data, q)
            shoulder = np.array([0.0, 0.0, data.oMi[2].translation[2]])  # axes 1 and 2 meet there
            assert np.abs(data.oMi[5].actInv(shoulder)[:2]).max() < 1e-12


def test_targets_from_csv(tmp_path: Path) -> None:
    path = tmp_path / "poses.csv"
    path.write_text("x,y,z,qw,qx,qy,qz,q1,q2\n0.1,0.2,0.3,0,1,0,0,1.5,-2\n1,2,3,1,0,0,0,nan,nan\n")
    wanted = targets.from_csv(path)
    assert wanted.name == "poses"
    assert wanted.poses[0].tolist() == [[1, 0, 0, 0.1], [0, -1, 0, 0.2], [0, 0, -1, 0.3], [0, 0, 0, 1]]
    assert wanted.generating[0].tolist() == [1.5, -2.0]
    assert np.isnan(wanted.generating[1]).all()


def test_newton_finds_the_generating_configuration(robot: Robot) -> None:
    rng = np.random.default_rng(4)
    q = robot.sample(rng)
    pose = robot.forward_kinematics(q).homogeneous
    roots = brute_force.newton_roots(robot, pose, rng)
    assert 2 <= len(roots) <= 16
    assert apart(roots, q).min() < 1e-9
    for root in roots:
        assert np.abs(robot.forward_kinematics(root).homogeneous - pose).max() < 1e-10


def test_table_is_aligned() -> None:
    assert report.table(("solver", "p99"), [("a", "1 us"), ("longer name", "12.5 ms")]) == (
        "| solver      |     p99 |\n| ----------- | ------: |\n| a           |    1 us |\n| longer name | 12.5 ms |"
    )


def test_promises_that_every_row_keeps_are_a_sentence() -> None:
    rows = [("a", "0", "1"), ("b", "0", "2")]
    assert report.condensed(("arm", "lost", "found"), rows, ("lost", "found")) == (
        "In every row: lost 0.\n\n| arm | found |\n| --- | ----: |\n| a   |     1 |\n| b   |     2 |"
    )
    broken = [("a", "0", "1"), ("b", "1", "2")]
    assert report.condensed(("arm", "lost", "found"), broken, ("lost",)) == report.table(
        ("arm", "lost", "found"), broken
    )


@pytest.mark.parametrize(
    ("share", "text"),
    [(1.0, "100 %"), (0.0, "0 %"), (0.999, "99.90 %"), (0.99999, "99.9990 %"), (0.995, "99.50 %"), (None, "-")],
)
def test_percent_says_100_only_for_all(share: float | None, text: str) -> None:
    assert report.percent(share) == text


def test_units() -> None:
    assert [report.seconds(value) for value in (25e-6, 2.5e-3, 3.0)] == ["25 us", "2.5 ms", "3 s"]
    assert report.number(1.23e-9, "m") == "1.2e-09 m"
    assert report.number(None, "m") == "-"


def test_page_holds_its_parts_in_order() -> None:
    sections = [report.Section("One", "first"), report.Section("Two", "Not measured: why", failed=True)]
    text = report.page("- Processor: x", sections)
    assert text.startswith("# Performance\n")
    assert text.index("Processor") < text.index("## One") < text.index("## Two") < text.index("why")


def test_part_that_fails_says_why() -> None:
    def explode() -> report.Section:
        raise RuntimeError("no display")

    section = run.measured("Pictures", explode)
    assert section.failed
    assert section.body == "Not measured: RuntimeError: no display"


@pytest.mark.parametrize(("printed", "kept"), [("slow: 3 ms", "slow: 3 ms"), ("", "Not measured: out of bounds")])
def test_part_that_ends_with_an_error_keeps_what_it_printed(
    printed: str, kept: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def end(command: list[str], **options: object) -> subprocess.CompletedProcess[str]:
        return subprocess.CompletedProcess(command, 1, printed, "Traceback\nout of bounds\n")

    monkeypatch.setattr(subprocess, "run", end)
    section = run.printed_section("viewer")
    assert section.failed
    assert kept in section.body
    assert "out of bounds" in section.body


def test_parts_that_print_are_run_with_their_arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    commands: list[list[str]] = []

    def note(command: list[str], **options: object) -> subprocess.CompletedProcess[str]:
        commands.append(command[2:])
        return subprocess.CompletedProcess(command, 0, "figures", "")

    monkeypatch.setattr(subprocess, "run", note)
    run.printed_section("viewer", quick=True)
    section = run.printed_section("latency", pictures=True)
    assert commands[0] == ["benchmarks.viewer", "--moves", "50"]
    assert commands[1][:2] == ["benchmarks.latency", "--picture"]
    assert "](images/latency.png)" in section.body


def test_targets_without_orientations_are_refused_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "positions.csv"
    path.write_text("x,y,z\n0.3,-0.2,0.5\n", encoding="utf-8")
    with pytest.raises(SystemExit) as leaving:
        run.main(["--only", "peers", "--targets", str(path)])
    assert leaving.value.code == 2
    assert "qw, qx, qy, qz" in capsys.readouterr().err


@pytest.mark.slow
def test_a_file_of_poses_is_solved_by_the_command(robot: Robot, tmp_path: Path) -> None:
    path = tmp_path / "poses.csv"
    pose_files.write(robot, path, 20)
    pose_files.run(path, workers=1)
    assert len((tmp_path / "answers.csv").read_text(encoding="utf-8").splitlines()) == 21
