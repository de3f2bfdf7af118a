"""The documentation site is complete: generated pages are current, pages in the menu, public names described."""

from __future__ import annotations

import inspect
import re
import struct
import tomllib
from pathlib import Path

import jacokin
from jacokin.model import NAMES
from jacokin.model.descriptions import bundled
from jacokin.tasks.registry import TASKS
from tests.scripts import load_script

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
AGAIN = "run python -m docs.tasks_page"


def described() -> set[str]:
    """Names that the API pages hand to mkdocstrings."""
    text = "\n".join(path.read_text(encoding="utf-8") for path in (DOCS / "api").glob("*.md"))
    return set(re.findall(r"^::: (\S+)$", text, re.M))


def test_page_of_numbers_is_what_the_table_gives() -> None:
    assert (DOCS / "robot.md").read_text(encoding="utf-8") == load_script(DOCS / "robot_page.py").page(), (
        "run python -m docs.robot_page"
    )


def test_page_of_numbers_has_every_robot_source_and_doubt() -> None:
    text = (DOCS / "robot.md").read_text(encoding="utf-8")

    def doubts(node: object) -> list[str]:
        if not isinstance(node, dict):
            return []
        own = [node["doubt"]] if "doubt" in node else []
        return own + [doubt for child in node.values() for doubt in doubts(child)]

    for name in NAMES:
        assert f"### {name}: " in text
    for key, source in bundled.robot_table()["sources"].items():
        assert f"| {key} | {source} |" in text
    everything = doubts(dict(bundled.robot_table())) + doubts(dict(bundled.robot_table("shapes.toml")))
    assert len(everything) > 20
    for doubt in everything:
        assert doubt in text


def test_masses_of_the_page_add_up_to_what_is_loaded() -> None:
    text = (DOCS / "robot.md").read_text(encoding="utf-8")
    for name in NAMES:
        model = jacokin.load_robot(name).pin_model
        total = sum(inertia.mass for inertia in model.inertias)
        assert f"### {name}: {total:.4f} kg" in text


def test_every_page_is_in_the_menu_and_exists() -> None:
    menu = set(re.findall(r"(\S+\.md)$", (ROOT / "mkdocs.yml").read_text(encoding="utf-8"), re.M))
    assert menu == {str(path.relative_to(DOCS)) for path in DOCS.rglob("*.md")}


def test_every_public_name_is_described() -> None:
    names = {f"jacokin.{name}" for name in jacokin.__all__ if name != "__version__"}
    assert names <= described()


def test_the_site_needs_no_network() -> None:
    settings = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert "font: false" in settings
    assert "http" not in settings


def test_relative_links_lead_somewhere() -> None:
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *DOCS.rglob("*.md")]
    for page in pages:
        text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
        for link in re.findall(r"\]\(([^)#\s]+)(?:#[^)\s]*)?\)", text):
            if "://" not in link:
                assert (page.parent / link).exists(), f"{page.name}: {link}"


def test_images_are_small_png_files() -> None:
    images = sorted((DOCS / "images").glob("*.png"))
    assert images
    for image in images:
        content = image.read_bytes()
        assert content[:8] == b"\x89PNG\r\n\x1a\n"
        width, height = struct.unpack(">II", content[16:24])
        assert min(width, height) >= 400, image.name
        assert len(content) <= 150_000, image.name  # bytes; pages should load quickly, and so should clones


def test_moving_pictures_are_small_and_shown() -> None:
    moving = [file for file in (DOCS / "images").iterdir() if file.is_file() and file.suffix != ".png"]
    pages = "".join(page.read_text(encoding="utf-8") for page in (ROOT / "README.md", *DOCS.glob("*.md")))
    assert moving
    for file in moving:
        content = file.read_bytes()
        assert content[:6] == b"GIF89a"
        assert len(content) < 2_000_000, file.name  # bytes
        assert f"images/{file.name})" in pages


def test_the_list_of_tasks_is_current() -> None:
    """But for the numbers of the experts, which a benchmark writes."""
    tasks_page = load_script(DOCS / "tasks_page.py")
    head = "| task | Gymnasium | its expert solves |"
    wanted, found = (
        text.partition(head)[::2] for text in (tasks_page.page(), (DOCS / "task_list.md").read_text(encoding="utf-8"))
    )
    assert wanted[0] == found[0], AGAIN
    assert wanted[1].partition("\n## ")[2] == found[1].partition("\n## ")[2], AGAIN
    for name in TASKS:
        assert f"\n## {name}\n" in found[1]
        assert f"(images/tasks/{name}.png)" in found[1]
    pictures = list((DOCS / "images" / "tasks").iterdir())
    assert sum(picture.stat().st_size for picture in pictures) < 1_000_000  # bytes, together
    assert {f"images/tasks/{picture.name}" for picture in pictures} <= set(re.findall(r"\]\(([^)]+)\)", found[1]))


def test_the_readme_shows_the_table_that_the_benchmark_wrote() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert load_script(DOCS / "readme_table.py").with_table(text) == text, "run python -m docs.readme_table"
    assert "| jacokin `solve_all` | 100 % |" in text


def test_statuses_are_explained_in_their_own_words() -> None:
    text = (DOCS / "inverse_kinematics.md").read_text(encoding="utf-8")
    for status in jacokin.Status:
        assert f"| `{status.name}` | {status.value} |" in text


def test_defaults_in_the_table_of_options_are_those_of_the_code() -> None:
    text = (DOCS / "inverse_kinematics.md").read_text(encoding="utf-8")
    options = inspect.signature(jacokin.IKSolver).parameters
    shown = dict(re.findall(r"^\| `(\w+)` \| `([^`]+)` \|", text, re.M))
    assert set(shown) == set(options) - {"robot", "frame", "tool"}
    for name, default in shown.items():
        assert default == repr(options[name].default)


def test_the_files_that_the_overview_names_exist_and_hold_what_it_says() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").partition("## Where things are")[2]
    text = text.partition("**C programs**")[0]
    named = re.findall(r"`([\w/]+\.(?:py|toml))`", text)
    assert len(named) > 15
    package = Path(jacokin.__file__).parent
    for name in named:
        assert any((root / name).is_file() for root in (ROOT, package)), name
    holds = {  # file in the package, text that is only where the thing is
        "model/obstacles.py": "class Box",
        "kernels/closed_form/resultant.py": "def resultant",
        "ik/verification.py": "class Verifier",
        "ik/results.py": "class Status",
        "ik/diagnosis.py": "Status.UNREACHABLE",
        "ik/qp.py": "mink",
        "motion/tracking/tracker.py": "def step",
        "mujoco_bridge/simulation/binding.py": "class Binding",
        "mujoco_bridge/updater.py": "delay",
        "tasks/families.py": "def reward",
        "cli/units.py": "class Units",
    }
    for name, thing in holds.items():
        assert f"`{name}`" in text
        assert thing in (package / name).read_text(encoding="utf-8"), name


def test_every_dependency_is_described() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    text = (DOCS / "dependencies.md").read_text(encoding="utf-8")
    needed, extras = text.split("Extras, installed")
    assert sorted(re.findall(r"^\| `([\w-]+)` \|", needed, re.M)) == sorted(_names(project["dependencies"]))
    for extra, packages in project["optional-dependencies"].items():
        if extra in ("test", "docs", "release"):
            continue
        for name in _names(packages):
            assert extras.count(f"| `{extra}` | `{name}` |") == 1


def _names(requirements: list[str]) -> list[str]:
    return [re.split(r"[\[<>=!~; ]", requirement)[0] for requirement in requirements]
