"""The Makefile rebuilds what changed, and lets warnings of the documentation through."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
WHEEL = "dist/jacokin-0-py3-none-any.whl"

pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")


def make(folder: Path, *words: str) -> str:
    done = subprocess.run(["make", *words], cwd=folder, capture_output=True, text=True, check=True)
    return done.stdout


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A small repository with this Makefile, in which the wheel has just been built."""
    for name in (
        "Makefile",
        "pyproject.toml",
        "constraints.txt",
        "constraints-oldest.txt",
        "README.md",
        "LICENSE",
        "NOTICE",
    ):
        shutil.copy(ROOT / name, tmp_path)
    for name in (
        "package_page.py",
        "examples/targets.csv",
        "jacokin/a.py",
        "jacokin/py.typed",
        "urdf/jaco.toml",
        ".venv/bin/python",
        "dist/jacokin-0-py3-none-any.whl",
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    make(tmp_path, "-n", "build")
    old = time.time() - 10.0
    for file in tmp_path.rglob("*"):
        os.utime(file, (old, old))
    stamp = tmp_path / "dist/wheel.stamp"
    stamp.touch()
    os.utime(stamp, (old + 5.0, old + 5.0))  # make compares times, and clocks of files tick coarsely
    return tmp_path


def test_nothing_is_built_twice(clone: Path) -> None:
    assert "build --wheel" not in make(clone, "-n", "build")


@pytest.mark.parametrize("change", ["edit", "add", "remove", "rename"])
def test_every_change_of_the_sources_builds_the_wheel_anew(clone: Path, change: str) -> None:
    file = clone / "jacokin/py.typed"
    if change == "edit":
        os.utime(file, (time.time() + 5.0, time.time() + 5.0))
    elif change == "add":
        (clone / "jacokin/b.py").touch()
        os.utime(clone / "jacokin/b.py", (1.0, 1.0))  # as old as a checkout may make it
    elif change == "remove":
        file.unlink()
    else:
        file.rename(clone / "jacokin/c.py")
    assert "build --wheel" in make(clone, "-n", "build")


def test_both_environments_get_the_wheel_of_the_same_version_again(clone: Path) -> None:
    for target in ("test", "test-oldest"):
        assert f"--force-reinstall --no-deps {WHEEL}" in make(clone, "-n", target)


def test_a_release_needs_the_address_of_the_repository(clone: Path) -> None:
    page = clone / "package_page.py"
    page.write_text('REPOSITORY = "https://repository-address.invalid/jacokin"\n', encoding="utf-8")
    done = subprocess.run(["make", "release-check"], cwd=clone, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "fill in the address of the repository" in done.stdout
    assert not (clone / ".venv/release.stamp").exists()
    page.write_text('REPOSITORY = "https://example.org/jacokin"\n', encoding="utf-8")
    make(clone, "address")


def test_the_site_is_built_with_its_warnings_heard(clone: Path) -> None:
    """mkdocs counts only warnings that it would show."""
    words = make(clone, "-n", "docs")
    assert "--strict" in words
    assert "--quiet\n" not in words.partition("mkdocs")[2]
