"""What the documentation shows is run: Python blocks, and lines that begin with `$ jacokin`.

The Python blocks of a page run one after another in one namespace. A shell line is expected to leave with 0, or with
the N of a trailing `# exit N`. A block after the comment `<!-- no-run: reason -->` is left out.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import jacokin
from jacokin.cli.doctor import rendering
from jacokin.cli.doctor.finding import OK
from jacokin.cli.main import main

ROOT = Path(__file__).resolve().parents[2]
PAGES = [path for path in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))) if path.exists()]
BLOCK = re.compile(r"^(?P<skip><!-- no-run: .+? -->\s*\n)?```(?P<kind>[a-z]+)[^\n]*\n(?P<code>.*?)^```", re.M | re.S)
EXIT_CODE = re.compile(r"#\s*exit (\d)\s*$")


def blocks(page: Path, kinds: tuple[str, ...]) -> list[tuple[int, str]]:
    """Line in the page and text of every block of these kinds that is to run."""
    text = page.read_text(encoding="utf-8")
    return [
        (text.count("\n", 0, match.start("code")), match["code"])
        for match in BLOCK.finditer(text)
        if match["kind"] in kinds and match["skip"] is None
    ]


def commands(page: Path) -> list[str]:
    """The `$ jacokin` lines of a page, continued lines joined."""
    code = "".join(code for _, code in blocks(page, ("console", "bash", "sh", "shell")))
    return re.findall(r"^\$ (jacokin .*)$", code.replace("\\\n", " "), re.M)


WITH_PYTHON = [page for page in PAGES if blocks(page, ("python",))]
COMMANDS = [(page, command) for page in PAGES for command in commands(page)]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A scratch folder that looks like the repository to what reads it."""
    for name in ("examples", "urdf"):
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def environment() -> dict[str, str]:
    """Where the package is found, and a back end that renders if there is one."""
    works = [finding.name for finding in rendering.renderers() if finding.state == OK]
    backend = {"MUJOCO_GL": works[0]} if works else {}
    return {**os.environ, "PYTHONPATH": str(Path(jacokin.__file__).parent.parent), **backend}


@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_PYTHON, ids=lambda page: str(page.relative_to(ROOT)))
def test_python_blocks_run(page: Path, folder: Path, environment: dict[str, str]) -> None:
    lines = [""] * (page.read_text(encoding="utf-8").count("\n") + 1)
    for first, code in blocks(page, ("python",)):
        for offset, line in enumerate(code.splitlines()):
            lines[first + offset] = line  # the line numbers of an error are those of the page
    program = folder / f"{page.stem}.py"
    program.write_text("\n".join(lines), encoding="utf-8")
    words = [sys.executable, str(program)]
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
    if "MUJOCO_GL" not in environment and "no picture can be rendered" in done.stderr:
        pytest.skip("no rendering back end")
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("page", "command"), COMMANDS, ids=[f"{page.relative_to(ROOT)}: {command}" for page, command in COMMANDS]
)
def test_commands_run(page: Path, command: str) -> None:
    expected = EXIT_CODE.search(command)
    with pytest.raises(SystemExit) as leaving:
        main(shlex.split(command, comments=True)[1:])
    assert (leaving.value.code or 0) == (int(expected[1]) if expected else 0)


def test_there_is_something_to_run() -> None:
    assert WITH_PYTHON
    assert COMMANDS
