"""What the documentation shows is run: Python blocks, and lines that begin with `$ jacokin`.

The Python blocks of a page run one after another in one namespace. A shell line is expected to leave with 0, or with
the N of a trailing `# exit N`. A block after the comment `<!-- no-run: reason -->` is left out, one after
`<!-- draws -->` only where MuJoCo cannot draw.
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
from jacokin.cli.main import main
from tests.gripper_arms import so101_text
from tests.programs import backends
from tests.robot_files import ur5_text

ROOT = Path(__file__).resolve().parents[2]
PAGES = [path for path in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))) if path.exists()]
BLOCK = re.compile(
    r"^(?:<!-- (?P<mark>no-run: .+?|draws) -->\s*\n)?```(?P<kind>[a-z]+)[^\n]*\n(?P<code>.*?)^```", re.M | re.S
)
WIDEST = 88  # columns
#: Stand in for the makers' files.
MAKERS = {"so101_new_calib.urdf": so101_text(), "ur5.urdf": ur5_text()}
#: The first line of programs that draw, so that they draw soon: that of a page is its title.
SMALL = "from examples import drawing; drawing.WIDTH, drawing.HEIGHT = 160, 120"
EXIT_CODE = re.compile(r"#\s*exit (\d)\s*$")


def blocks(page: Path, kinds: tuple[str, ...], *, draws: bool = True) -> list[tuple[int, str]]:
    """Line in the page and text of every block of these kinds that is to run."""
    text = page.read_text(encoding="utf-8")
    return [
        (text.count("\n", 0, match.start("code")), match["code"])
        for match in BLOCK.finditer(text)
        if match["kind"] in kinds and (match["mark"] is None or (match["mark"] == "draws" and draws))
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
    for name, text in MAKERS.items():
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def environment() -> dict[str, str]:
    """Where the package is found, and a back end that renders if there is one."""
    backend = {"MUJOCO_GL": backends()[0]} if backends() else {}
    return {**os.environ, "PYTHONPATH": str(Path(jacokin.__file__).parent.parent), **backend}


@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_PYTHON, ids=lambda page: str(page.relative_to(ROOT)))
def test_python_blocks_run(page: Path, folder: Path, environment: dict[str, str]) -> None:
    lines = [""] * (page.read_text(encoding="utf-8").count("\n") + 1)
    for first, code in blocks(page, ("python",), draws="MUJOCO_GL" in environment):
        for offset, line in enumerate(code.splitlines()):
            lines[first + offset] = line  # the line numbers of an error are those of the page
    if any("examples.drawing" in line for line in lines):
        lines[0] = SMALL
    program = folder / f"{page.stem}.py"
    program.write_text("\n".join(lines), encoding="utf-8")
    words = [sys.executable, str(program)]
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
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
    assert {"README.md", "index.md", "observables.md"} <= {page.name for page in WITH_PYTHON}
    assert len(COMMANDS) > 10


def test_code_fits_into_the_page() -> None:
    """Wider lines are cut off on the site."""
    wide = [
        f"{page.name}: {line}"
        for page in PAGES
        if page.name != "performance.md"  # tables that benchmarks print, which scroll
        for match in BLOCK.finditer(page.read_text(encoding="utf-8"))
        for line in match["code"].splitlines()
        if len(line) > WIDEST
    ]
    assert wide == []
