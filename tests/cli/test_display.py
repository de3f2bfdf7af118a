"""Tables that fit the terminal, JSON of what JSON lacks, and progress where there is a terminal."""

from __future__ import annotations

import io
import json
import os
import shutil
import sys
import time

import numpy as np
import pytest

from jacokin.cli import display
from jacokin.ik import Status


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def narrow_terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """A terminal of 60 columns as standard output and error."""
    terminal = Terminal()
    monkeypatch.setattr(sys, "stdout", terminal)
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(shutil, "get_terminal_size", lambda fallback=None: os.terminal_size((60, 24)))
    return terminal


def test_text_is_broken_where_a_table_is_too_wide_and_numbers_are_not(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = narrow_terminal(monkeypatch)
    why = "no joint angles reach this pose, with or without the limits of the joints"
    display.show_table("Not solved", ("line", "why", "error [m]"), [("3", why, "0.123456")], text=2)
    lines = terminal.getvalue().splitlines()
    assert lines[0] == "Not solved"
    assert max(map(len, lines)) <= 60
    assert sum("0.123456" in line for line in lines) == 1
    assert why in " ".join(" ".join(lines[4:]).replace("0.123456", "").split()).removeprefix("3 ")


def test_facts_are_names_and_texts_in_columns(capsys: pytest.CaptureFixture[str]) -> None:
    display.show_facts([("file", "a.urdf"), ("base", "link\x1b[31m")], "robot")
    assert capsys.readouterr().out == "robot\n\n  file   a.urdf\n  base   link\\x1b[31m\n\n"


def test_json_has_names_for_enums_and_null_for_what_is_infinite(capsys: pytest.CaptureFixture[str]) -> None:
    document = {"status": Status.OK, "q": np.array([0.1, np.inf]), "n": np.int64(3), "pairs": [("a", "b")], "x": None}
    display.print_json(document)
    found = json.loads(capsys.readouterr().out)
    assert found == {"status": "OK", "q": [0.1, None], "n": 3, "pairs": [["a", "b"]], "x": None}


def test_progress_is_shown_on_a_terminal_and_erased(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = narrow_terminal(monkeypatch)
    with display.progress_bar("solving") as show:
        show(0, 200)
        assert terminal.getvalue() == f"{display.CLEAR}solving 0 of 200 (0 %)"
    assert terminal.getvalue().endswith(display.CLEAR)


def test_progress_is_one_line_of_the_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = narrow_terminal(monkeypatch)
    monkeypatch.setattr(Terminal, "fileno", lambda _: 2)
    monkeypatch.setattr(os, "get_terminal_size", lambda _: os.terminal_size((20, 24)))
    with display.progress_bar("solving") as show:
        show(0, 200)
        assert terminal.getvalue() == f"{display.CLEAR}solving 0 of 200 (0"


def test_a_terminal_without_control_characters_gets_none(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = narrow_terminal(monkeypatch)
    monkeypatch.setenv("TERM", "dumb")
    monkeypatch.setattr(display, "LINE_PERIOD", 0.0)
    with display.progress_bar("solving") as show:
        show(0, 200)
    assert terminal.getvalue() == "jacokin: solving 0 of 200 (0 %)\n"


def test_no_progress_goes_into_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    with display.progress_bar("solving") as show:
        show(1, 2)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(("seconds", "said"), [(12.0, "12 s"), (600.0, "10 min"), (7200.0, "2.0 h")])
def test_durations_are_short(seconds: float, said: str) -> None:
    assert display.format_duration(seconds) == said


def test_progress_without_a_terminal_is_a_line_now_and_then(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = [100.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    with display.progress_bar("solving") as show:
        for done in range(0, 50, 10):
            show(done, 200)
            now[0] += 4.0
        show(50, None)
    assert capsys.readouterr().err == (
        "jacokin: solving 30 of 200 (15 %), 2/s, 68 s left\n"  # twelve seconds after the first
    )


def test_a_long_step_says_how_long_it_takes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(display, "LINE_PERIOD", 0.05)
    monkeypatch.setattr(display, "LOOK_PERIOD", 0.01)
    lines: list[str] = []
    with display.progress_bar("looking for places") as show:
        while len(lines) < 2:
            time.sleep(0.01)
            lines += capsys.readouterr().err.splitlines()
        show(3, 12)
        while not lines[-1].endswith("so far") or "3 of 12" not in lines[-1]:
            time.sleep(0.01)
            lines += capsys.readouterr().err.splitlines()
    assert lines[0] == "jacokin: looking for places, 0 s so far"
