"""Help, version, and what starting the command line loads."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

import jacokin
from jacokin.cli.main import COMMANDS, GROUPS
from tests.cli.run import HOME, Run


@pytest.mark.parametrize(
    "command", ["", *COMMANDS, *(f"{group} {name}" for group, (_, names) in GROUPS.items() for name in names)]
)
def test_help_teaches_by_example(run: Run, command: str) -> None:
    answer = run(*command.split(), "--help")
    assert answer.code == 0
    assert f"  jacokin {command}".rstrip() in answer.out
    assert "Examples:" in answer.out


@pytest.mark.parametrize("words", [(), *((group,) for group in GROUPS)])
def test_every_command_is_listed_with_its_whole_sentence(run: Run, words: tuple[str, ...]) -> None:
    text = run(*words, "--help").out.partition("\nCommands:\n")[2]
    for name in GROUPS[words[0]][1] if words else (*COMMANDS, *GROUPS):
        assert f"  {name} " in text
    assert "..." not in text


def test_the_version_is_that_of_the_package(run: Run) -> None:
    assert run("--version").out == f"jacokin {jacokin.__version__}\n"


def test_help_loads_nothing_heavy() -> None:
    program = (
        "import sys\n"
        "from jacokin.cli.main import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
        "print([m for m in ('numpy', 'pinocchio', 'mujoco', 'mink', 'numba', 'orjson') if m in sys.modules])\n"
    )
    done = subprocess.run([sys.executable, "-P", "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_the_package_runs_as_a_module() -> None:
    words = [sys.executable, "-P", "-m", "jacokin", "fk", *HOME, "--json"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout)["frame"] == "end_effector"
