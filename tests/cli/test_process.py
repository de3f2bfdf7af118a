"""The command as a process: closed streams, full disks, signals, and what is left behind."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import jacokin
from tests.cli.run import HOME, POSE

COMMAND = [sys.executable, "-P", "-m", "jacokin"]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(Path(jacokin.__file__).parent.parent)}
DEADLINE = 60.0  # [s]

# What a process does before the first line of the command: close its streams.
CLOSED = {"stdin": "<&-", "stdout": ">&-", "stderr": "2>&-"}


def shell(words: str) -> subprocess.CompletedProcess[str]:
    line = words.replace("jacokin", f"'{sys.executable}' -P -m jacokin")
    return subprocess.run(
        ["sh", "-c", line], capture_output=True, text=True, check=False, env=ENVIRONMENT, timeout=DEADLINE
    )


@pytest.mark.parametrize("stream", CLOSED)
def test_a_closed_stream_changes_neither_code_nor_files(tmp_path: Path, stream: str) -> None:
    targets, out = tmp_path / "targets.csv", tmp_path / "out.csv"
    targets.write_text("x,y,z\n0.3,-0.2,0.5\n", encoding="utf-8")
    done = shell(f"jacokin ik --targets '{targets}' --output '{out}' {CLOSED[stream]}")
    assert (done.returncode, done.stderr) == (0, "")
    assert ("solved" in done.stdout) == (stream != "stdout")
    assert len(out.read_text(encoding="utf-8").splitlines()) == 2


def test_a_pipe_that_is_closed_early_is_no_traceback() -> None:
    done = shell("jacokin ik --position 0.3 -0.2 0.5 --down --all --json | true")
    assert "Traceback" not in done.stderr
    assert "ipe" not in done.stderr  # "Broken pipe"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("words", ["--json", ""])
def test_output_that_cannot_be_written_is_one_sentence_and_code_2(words: str) -> None:
    done = shell(f"jacokin fk {' '.join(HOME)} {words} >/dev/full")
    assert done.returncode == 2
    assert done.stderr == "jacokin: the output: No space left on device\n"


def started(*words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*COMMAND, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=ENVIRONMENT
    )


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT], ids=lambda number: number.name)
def test_a_signal_leaves_the_old_output_and_beside_it_at_most_finished_chunks(
    tmp_path: Path, number: signal.Signals
) -> None:
    targets, out = tmp_path / "targets.csv", tmp_path / "out.csv"
    targets.write_text("x,y,z\n" + "9,9,9\n" * 3000, encoding="utf-8")  # each takes a while
    out.write_text("old", encoding="utf-8")
    process = started("ik", "--targets", str(targets), "--output", str(out))
    deadline = time.monotonic() + DEADLINE
    while len(list(tmp_path.iterdir())) < 3:  # until the temporary file is there
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.01)
    time.sleep(1.0)  # until everything is imported: callbacks of the import lock ignore interrupts, with a traceback
    process.send_signal(number)
    _, errors = process.communicate(timeout=DEADLINE)
    assert process.returncode == 128 + number
    assert "Traceback" not in errors
    assert out.read_text(encoding="utf-8") == "old"
    beside = {path.name for path in tmp_path.iterdir()} - {"out.csv", "targets.csv"}
    assert beside <= {"out.csv.chunks"}
    if beside:  # what had begun was finished, and `--resume` goes on from it
        endings = {path.suffix for path in (tmp_path / "out.csv.chunks").iterdir()}
        assert endings == {".json", ".chunk"}


@pytest.mark.slow
def test_ctrl_c_at_any_moment_is_no_traceback_of_ours() -> None:
    """Python shows one of its own while it starts, before `main` of the entry point."""
    for delay in (0.01, 0.02, 0.03, 0.05, 0.08, 0.13, 0.2, 0.3):
        process = started("ik", *POSE)
        time.sleep(delay)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=DEADLINE)
        assert not re.search(r'entry\.py", line [0-9]+, in main', errors), (delay, errors)


def test_control_characters_do_not_reach_the_terminal(tmp_path: Path) -> None:
    file = tmp_path / "targets.csv"
    file.write_text("x,y,z,\x1b[31mred\x07\n1,2,3,4\n", encoding="utf-8")
    done = subprocess.run([*COMMAND, "ik", "--targets", str(file)], capture_output=True, check=False, env=ENVIRONMENT)
    assert done.returncode == 2
    assert rb"\x1b[31mred\x07" in done.stderr
    assert not set(done.stderr) & {0x1B, 0x07}


def test_a_terminal_without_the_characters_gets_escapes() -> None:
    environment = {**ENVIRONMENT, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    done = subprocess.run([*COMMAND, "info", "--json"], capture_output=True, check=True, env=environment)
    assert json.loads(done.stdout)["robot"] == "j2n6s300"
    done = subprocess.run([*COMMAND, "info"], capture_output=True, check=True, env=environment)
    assert b"joint_1" in done.stdout
