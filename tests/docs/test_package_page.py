"""What an index shows of the package, and what the package holds."""

from __future__ import annotations

import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
from hatchling.metadata.core import ProjectMetadata
from hatchling.plugin.manager import PluginManager

import jacokin

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT))  # last: the installed package is what gets tested

from package_page import REPOSITORY, with_absolute_links, with_clone  # noqa: E402 - found by the line above


@pytest.fixture(scope="module")
def metadata() -> ProjectMetadata[PluginManager]:
    return ProjectMetadata(str(ROOT), PluginManager())


def test_the_version_stands_in_one_place(metadata: ProjectMetadata[PluginManager]) -> None:
    assert metadata.version == jacokin.__version__
    assert "version" not in tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_links_of_the_page_work_away_from_the_repository(metadata: ProjectMetadata[PluginManager]) -> None:
    page = metadata.core.readme
    links = re.findall(r"\]\(([^)]+)\)", page)
    assert len(links) > 10
    assert all(re.match(r"https?://|#", link) for link in links)
    pictures = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page)
    assert pictures
    assert all(picture.startswith(f"{REPOSITORY}/raw/") for picture in pictures)
    for link in links:
        if link.startswith(REPOSITORY):
            path = re.sub(rf"{re.escape(REPOSITORY)}/\w+/main/", "", link).partition("#")[0]
            assert (ROOT / path).exists(), link


def test_the_page_says_where_the_clone_comes_from(metadata: ProjectMetadata[PluginManager]) -> None:
    clone = (
        f"```bash\ngit clone {REPOSITORY} jacokin && cd jacokin\npython3 -m venv .venv && . .venv/bin/activate\npip "
    )
    assert clone in metadata.core.readme
    with pytest.raises(ValueError, match="in a clone"):
        with_clone("pip install jacokin")


def test_only_relative_links_change() -> None:
    text = "[a](b.md#c) [d](#e) [f](https://g/h) ![i](j.png) ![k](https://l/m.png)"
    expected = (
        f"[a]({REPOSITORY}/blob/main/b.md#c) [d](#e) [f](https://g/h) "
        f"![i]({REPOSITORY}/raw/main/j.png) ![k](https://l/m.png)"
    )
    assert with_absolute_links(text) == expected


@pytest.mark.slow
def test_packages_hold_what_they_should(tmp_path: Path) -> None:
    stray = ROOT / "stray-file-of-a-test.txt"
    stray.touch()
    try:
        for target in ("wheel", "sdist"):
            words = [sys.executable, "-P", "-m", "hatchling", "build", "-t", target, "-d", str(tmp_path)]
            subprocess.run(words, cwd=ROOT, check=True, capture_output=True)
    finally:
        stray.unlink()
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    assert {"jacokin/urdf/j2n6s300.urdf", "jacokin/urdf/jaco.toml", "jacokin/cli/targets.csv"} <= names
    assert not [name for name in names if name.startswith("jacokin/urdf/") and name.endswith(".py")]
    assert {name.partition("/")[0] for name in names} == {"jacokin", f"jacokin-{jacokin.__version__}.dist-info"}
    (sdist,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(sdist) as packages:
        packed = {name.partition("/")[2] for name in packages.getnames()}
    assert {"Makefile", "package_page.py", "tests/conftest.py", "docs/index.md", "urdf/generate.py"} <= packed
    assert not [name for name in packed if "stray" in name or "__pycache__" in name]


def test_the_citation_names_this_version() -> None:
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {jacokin.__version__}\n" in text


def test_hosted_ci_runs_targets_that_exist_with_pinned_actions() -> None:
    text = (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")
    actions = re.findall(r"uses: (\S+)", text)
    assert actions
    assert all(re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40}", action) for action in actions)
    targets = set(re.findall(r"run: make ([\w-]+)", text))
    assert {"demo", "lint", "type", "docs", "test-all", "test-oldest", "release-check"} == targets
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert all(re.search(rf"^{target}:", makefile, re.M) for target in targets)
    declared = re.findall(r"Python :: (3\.\d+)\"", (ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert declared == re.findall(r'"(3\.\d+)"', text.partition("python: ")[2].partition("\n")[0])
