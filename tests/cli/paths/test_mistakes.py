"""What `jacokin track` and `jacokin plan` refuse, before they compute anything."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli.run import Run

BOTH = (
    (("--dt", "0"), "--dt must be"),
    (("--dt", "-0.01"), "--dt must be"),
    (("--speed", "0"), "--speed"),
    (("--output", "trajectory.txt"), ".csv or .npz"),
    (("--output", "nowhere/trajectory.csv"), "nowhere"),
    (("--plot", "trajectory.doc"), ".png"),
    (("--frame", "link_9"), "link_6"),
    (("--seed", "1", "2"), "--seed"),
    (("--velocity-limit", "1", "2"), "--velocity-limit"),
    (("--scene", "none.yaml"), "cannot read none.yaml"),
)
TRACK = (
    (("--acceleration-limit", "0"), "--acceleration-limit"),
    (("--clearance", "-1"), "--clearance must be"),
)
PLAN = (
    (("--free-axis", "0 0 0"), "--free-axis must have a direction"),
    (("--free-axis", "1 0"), "--free-axis must be x, y, z or three numbers"),
    (("--free-axis", "w"), "--free-axis must be x, y, z or three numbers"),
    (("--free-axis", "x", "--free-range", "1", "-1"), "--free-range must be (least, largest)"),
    (("--free-range", "1", "2"), "--free-range needs --free-axis"),
    (("--timing", "fast"), "Valid: keep, slow"),
    (("--acceleration-limit", "2"), "needs --timing"),
    (("--clearance", "-1"), "--clearance must be"),
)


@pytest.mark.parametrize(
    ("command", "words", "message"),
    [(command, *case) for command, own in (("track", TRACK), ("plan", PLAN)) for case in (*BOTH, *own)],
)
def test_wrong_input_is_refused(path_file: Path, run: Run, command: str, words: tuple[str, ...], message: str) -> None:
    answer = run(command, "--path", str(path_file), *words)
    assert answer.code == 2
    assert message in answer.err
    assert answer.out == ""
    assert [file.name for file in path_file.parent.iterdir()] == ["path.csv"]


@pytest.mark.parametrize("command", ["track", "plan"])
def test_a_path_is_two_poses_with_orientations(path_file: Path, run: Run, command: str) -> None:
    lines = path_file.read_text(encoding="utf-8").splitlines()
    path_file.write_text("\n".join(lines[:2]), encoding="utf-8")
    assert "at least two" in run(command, "--path", str(path_file)).err
    path_file.write_text("x,y,z\n0.3,-0.2,0.5\n0.4,-0.2,0.5\n", encoding="utf-8")
    refused = run(command, "--path", str(path_file))
    assert refused.code == 2
    assert "orientations" in refused.err


def test_plotting_without_matplotlib_names_the_extra(
    path_file: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    refused = run("track", "--path", str(path_file), "--plot", "a.png")
    assert refused.code == 2
    assert "jacokin[plot]" in refused.err
