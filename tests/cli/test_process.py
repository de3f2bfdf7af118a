"""The command as a process: closed streams, full disks, signals, and what is left behind."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from jacokin.cli import process
from jacokin.cli.process import NOT_SOLVED, WRONG_INPUT
from tests.cli.run import ENVIRONMENT, HOME, POSE, Run, start

COMMAND = [sys.executable, "-P", "-m", "jacokin"]
DEADLINE = 60.0  # [s]

# What a process does before the first line of the command: close its streams.
CLOSED = {"stdin": "<&-", "stdout": ">&-", "stderr": "2>&-"}


def shell(words: str) -> subprocess.CompletedProcess[str]:
    line = words.replace("jacokin", f"'{sys.executable}' -P -m jacokin")
    return subprocess.run(
        ["sh", "-c", line], capture_output=True, text=True, check=False, env=ENVIRONMENT, timeout=DEADLINE
    )


@pytest.mark.parametrize(
    "stream", ["stdout", *(pytest.param(name, marks=pytest.mark.slow) for name in ("stdin", "stderr"))]
)
@pytest.mark.slow
def test_a_closed_stream_changes_neither_code_nor_files(tmp_path: Path, stream: str) -> None:
    targets, out = tmp_path / "targets.csv", tmp_path / "out.csv"
    targets.write_text("x,y,z,qw,qx,qy,qz\n0.3,-0.2,0.5,0,1,0,0\n", encoding="utf-8")
    done = shell(f"jacokin ik --targets '{targets}' --output '{out}' {CLOSED[stream]}")
    assert (done.returncode, done.stderr) == (0, "")
    assert ("solved" in done.stdout) == (stream != "stdout")
    assert len(out.read_text(encoding="utf-8").splitlines()) == 2


@pytest.mark.slow
def test_a_pipe_that_is_closed_early_is_no_traceback() -> None:
    done = shell("jacokin ik --position 0.3 -0.2 0.5 --down --all --json | true")
    assert "Traceback" not in done.stderr
    assert "ipe" not in done.stderr  # "Broken pipe"


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("words", "code"),
    [("info", 0), ("--help", 0), ("--version", 0), ("ik --help", 0), ("ik --position 2 0 0.5 --down --no-closest", 1)],
)
def test_a_reader_that_has_left_does_not_change_the_exit_code(words: str, code: int) -> None:
    read, write = os.pipe()
    os.close(read)
    try:
        done = subprocess.run(
            [*COMMAND, *words.split()],
            stdout=write,
            stderr=subprocess.PIPE,
            check=False,
            env=ENVIRONMENT,
            timeout=DEADLINE,
        )
    finally:
        os.close(write)
    assert (done.returncode, done.stderr) == (code, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("words", ["--json", ""])
def test_output_that_cannot_be_written_is_one_sentence_and_code_2(words: str) -> None:
    done = shell(f"jacokin fk {' '.join(HOME)} {words} >/dev/full")
    assert done.returncode == 2
    assert done.stderr == "jacokin: the output: No space left on device\n"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize(("words", "code"), [("fk 1 2 3 4 5 100", 0), ("ik --position 1", 2)])
def test_notes_that_nobody_reads_change_neither_code_nor_output(words: str, code: int) -> None:
    done = [shell(f"jacokin {words} 2>{where}") for where in ("/dev/null", "/dev/full")]
    assert [each.returncode for each in done] == [code, code]
    assert done[0].stdout == done[1].stdout


@pytest.mark.slow
def test_progress_whose_reader_has_left_ends_no_work(tmp_path: Path) -> None:
    targets = tmp_path / "targets.csv"
    targets.write_text("x,y,z\n" + "9,9,9\n" * 100, encoding="utf-8")
    before = "import jacokin.cli.display as display; display.LINE_PERIOD = 0.0"
    running = start("ik", "--targets", str(targets), "--output", str(tmp_path / "out.csv"), before=before)
    assert running.stdout is not None
    assert running.stderr is not None
    running.stderr.close()
    assert "0 of 100" in running.stdout.read()
    running.stdout.close()
    assert running.wait(DEADLINE) == NOT_SOLVED
    assert len((tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()) == 101


@pytest.mark.skipif(not Path("/dev/stdout").exists(), reason="needs /dev/stdout")
@pytest.mark.parametrize("words", [pytest.param("", marks=pytest.mark.slow), "--json"])
def test_answers_to_stdout_are_alone_there_and_keep_what_a_file_holds(tmp_path: Path, words: str) -> None:
    targets, out = tmp_path / "targets.csv", tmp_path / "out.csv"
    targets.write_text("x,y,z,qw,qx,qy,qz\n0.3,-0.2,0.5,0,1,0,0\n", encoding="utf-8")
    out.write_text("before\n", encoding="utf-8")
    command = f"jacokin ik --targets '{targets}' --output /dev/stdout {words}"
    done = shell(f"{{ {command}; echo after; }} >>'{out}'; {command} | cat")
    answers = done.stdout.splitlines()
    assert [line.partition(",")[0] for line in answers] == ["x", "0.3"]
    assert out.read_text(encoding="utf-8").splitlines() == ["before", *answers, "after"]
    assert done.stderr.count("/dev/stdout") == 2  # where they were written to


def test_lines_that_are_no_text_end_no_live_motion() -> None:
    environment = {**ENVIRONMENT, "PYTHONIOENCODING": "utf-8"}  # strict, as in most locales
    done = subprocess.run(
        [*COMMAND, "run", "--live", "--twin"],
        input=b'\xff\xfe\n{"end": true}\n',
        capture_output=True,
        check=True,
        env=environment,
        timeout=DEADLINE,
    )
    assert b"a line must be JSON" in done.stderr
    assert b"ARRIVED" in done.stdout


def test_a_folder_that_is_gone_is_not_called_the_output(tmp_path: Path) -> None:
    done = shell(f"mkdir '{tmp_path}/gone' && cd '{tmp_path}/gone' && rmdir '{tmp_path}/gone' && jacokin info")
    assert done.returncode == 2
    assert done.stderr == "jacokin: the folder that this was started in: No such file or directory\n"


SMALL_CHUNKS = "import jacokin.ik.batches.solve_file as batch; batch.SINGLE_ROWS = 4"


@pytest.mark.parametrize(
    "number",
    [signal.SIGINT, *(pytest.param(number, marks=pytest.mark.slow) for number in process.ENDING)],
    ids=lambda number: number.name,
)
@pytest.mark.slow
def test_a_signal_leaves_the_old_output_and_beside_it_finished_chunks(tmp_path: Path, number: signal.Signals) -> None:
    targets, out, chunks = tmp_path / "targets.csv", tmp_path / "out.csv", tmp_path / "out.csv.chunks"
    targets.write_text("x,y,z\n" + "9,9,9\n" * 3000, encoding="utf-8")  # out of reach: each takes a while
    out.write_text("old", encoding="utf-8")
    running = start("ik", "--targets", str(targets), "--output", str(out), before=SMALL_CHUNKS)
    deadline = time.monotonic() + DEADLINE
    while not list(chunks.glob("*.chunk")):  # until a chunk is solved, and so everything is imported
        assert running.poll() is None, running.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.01)
    running.send_signal(number)
    _, errors = running.communicate(timeout=DEADLINE)
    assert running.returncode == 128 + number
    assert "Traceback" not in errors
    assert ("goes on from there" in errors) == (number == signal.SIGINT)
    assert out.read_text(encoding="utf-8") == "old"
    assert {path.name for path in tmp_path.iterdir()} == {"out.csv", "out.csv.chunks", "targets.csv"}
    assert {path.suffix for path in chunks.iterdir()} == {".json", ".chunk"}  # `--resume` goes on from them


@pytest.mark.parametrize("number", process.ENDING, ids=lambda number: number.name)
def test_signals_are_handled_while_a_command_runs_unless_they_are_ignored(number: signal.Signals) -> None:
    before = signal.getsignal(number)
    try:
        for usual in (signal.SIG_DFL, signal.SIG_IGN):  # nohup ignores SIGHUP
            signal.signal(number, usual)
            with process.around_command():
                assert (signal.getsignal(number) is usual) == (usual is signal.SIG_IGN)
            assert signal.getsignal(number) is usual
    finally:
        signal.signal(number, before)


def test_a_signal_is_heeded_though_its_exception_was_dropped() -> None:
    with process.around_command():
        process.heed_signals()  # none has come
        with contextlib.suppress(SystemExit):
            os.kill(os.getpid(), signal.SIGTERM)
        with pytest.raises(SystemExit) as left:
            process.heed_signals()
        assert left.value.code == 128 + signal.SIGTERM
    process.heed_signals()  # of that command alone


# Press Ctrl-C when a module is about to be imported.
INTERRUPT = """
import os, sys
class Interrupt:
    def find_spec(name, path, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interrupt)
"""


@pytest.mark.parametrize(
    ("module", "code", "said"),
    [
        ("click", -signal.SIGINT, ""),
        ("jacokin.cli.main", -signal.SIGINT, ""),
        ("jacokin.cli.ik", 130, "interrupted"),  # the command is loaded
        ("jacokin.model.loading", 130, "interrupted"),  # it runs
    ],
)
def test_ctrl_c_at_any_moment_is_no_traceback(module: str, code: int, said: str) -> None:
    running = start("ik", *POSE, before=INTERRUPT.format(module=module))
    out, errors = running.communicate(timeout=DEADLINE)
    assert (running.returncode, out) == (code, "")
    assert errors.strip() == (said and f"jacokin: {said}")


def test_ctrl_c_while_a_compiled_module_is_loaded_is_no_broken_installation() -> None:
    """The module's loader turns it into an ImportError."""
    raising = 'raise ImportError("initialization failed") from KeyboardInterrupt()'
    before = INTERRUPT.format(module="mujoco").replace("os.kill(os.getpid(), signal.SIGINT)", raising)
    running = start("task", "reach_site", before=before)
    out, errors = running.communicate(timeout=DEADLINE)
    assert (running.returncode, out, errors.strip()) == (130, "", "jacokin: interrupted")


def test_control_characters_do_not_reach_the_terminal(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "targets.csv"
    name = "\x1b[31mred\x07"
    for header, code in ((f"x,y,z,{name}", NOT_SOLVED), (f"x,y,{name},{name}", WRONG_INPUT)):
        file.write_text(f"{header}\n1,2,3,4\n", encoding="utf-8")
        answer = run("ik", "--targets", file, "--output", tmp_path / "joints.csv", code=code)
        assert r"\x1b[31mred\x07" in answer.out + answer.err
        assert not set(answer.out + answer.err) & {"\x1b", "\x07"}


@pytest.mark.slow
def test_a_terminal_without_the_characters_gets_escapes() -> None:
    environment = {**ENVIRONMENT, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    done = subprocess.run([*COMMAND, "info", "--json"], capture_output=True, check=True, env=environment)
    assert json.loads(done.stdout)["robot"] == "j2n6s300"
    done = subprocess.run([*COMMAND, "info"], capture_output=True, check=True, env=environment)
    assert b"joint_1" in done.stdout
