"""The playground of the documentation in Chromium, opened from a folder: what it shows is what Python answers."""

from __future__ import annotations

import functools
import importlib.util
import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import jacokin
from jacokin.arrays import Array
from jacokin.ik import IKSolver
from tests.viewer.chromium import IN_BROWSER, STARTING, Tab, browsing
from tests.viewer.page import until

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
WEB = ROOT / "integrations" / "web"
NAMES = ("j2n6s300", "j2s6s300", "m1n6s200", "gen3_lite", "gen3_6dof", "j2s7s300", "gen3")
#: States that are compared with Python's answers, of arms with six joints.
STATES = {"j2n6s300": 20, "j2s6s300": 10, "gen3_lite": 10, "m1n6s200": 10}
CLOSE = 1e-9  # [rad] between the same branch here and there: a well conditioned one agrees to 1e-12
PAGE = """<!DOCTYPE html><html lang="en"><meta charset="utf-8"><title>playground</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="stylesheet" href="playground/playground.css">
<body style="margin: 8px; font: 20px sans-serif" data-md-color-scheme="default" class="md-typeset">
<div id="pg-root" class="pg"></div><p id="pg-keys"></p>
<script>globalThis.errors = []; addEventListener("error", (event) => errors.push(event.message));
addEventListener("unhandledrejection", (event) => errors.push(String(event.reason)));</script>
<script src="playground/playground.js" defer></script>"""
READY = "globalThis.jacokinPlayground?.answer?.status"
#: Where a handle is on the page: its middle, and a point further along its axis.
HANDLE = """(() => {
  const { camera, pose, panel } = jacokinPlayground;
  const { left, top } = panel.handles.getBoundingClientRect();
  const at = (up) => {
    const point = [pose[3], pose[7], pose[11] + up];
    const { x, y } = camera.project(point, panel.handles.clientWidth, panel.handles.clientHeight);
    return [left + x, top + y];
  };
  return [at(0.0), at(0.1)];
})()"""
SHOW = """(async () => {
  const page = jacokinPlayground;
  const shown = [];
  for (const q of %s) {
    await page.load(%s, { q });
    await page.settled();
    shown.push(page.state());
  }
  return shown;
})()"""
STATE = "jacokinPlayground.settled().then(() => jacokinPlayground.state())"

pytestmark = [
    *IN_BROWSER,
    pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="ziglang is not installed"),
]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page with nothing around it."""
    folder = tmp_path_factory.mktemp("site")
    web = folder / "web"
    shutil.copytree(WEB, web, ignore=shutil.ignore_patterns("*.wasm", "robots.js", "reference", "*.tgz"))
    done = subprocess.run([sys.executable, WEB / "build.py", web], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    spec = importlib.util.spec_from_file_location("playground_files", DOCS / "playground_files.py")
    assert spec is not None
    assert spec.loader is not None
    files = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(files)
    scripts = folder / "playground"
    scripts.mkdir()
    (scripts / "playground.js").write_text(files.page_script(web), encoding="utf-8")
    for name in NAMES:
        (scripts / f"{name}.js").write_text(files.robot_script(name), encoding="utf-8")
    shutil.copy(DOCS / "playground" / "playground.css", scripts)
    (folder / "playground.html").write_text(PAGE, encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def browser(site: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    with browsing("about:blank", tmp_path_factory.mktemp("chromium")) as tab:
        yield tab


@pytest.fixture
def tab(browser: Tab, site: Path) -> Iterator[Tab]:
    """The page anew, 1000 x 700 pixels; no script of it may fail."""
    show(browser, site, "", 1000)
    yield browser
    assert browser.value("errors") == []


def show(tab: Tab, site: Path, state: str, width: int) -> None:
    tab.ask("Emulation.setDeviceMetricsOverride", width=width, height=700, deviceScaleFactor=1, mobile=False)
    tab.ask("Page.navigate", url="about:blank")
    tab.ask("Page.navigate", url=f"{(site / 'playground.html').as_uri()}{state}")
    assert until(lambda: tab.value(READY), STARTING), tab.value("document.body.innerText + errors")


def state_of(tab: Tab, script: str = STATE) -> Any:
    return tab.value(script)


@functools.cache
def solver_of(name: str) -> IKSolver:
    return IKSolver(jacokin.load_robot(name), collision="ignore")


def difference(first: Array, second: Array) -> Array:
    """[rad] the largest of the joints, of each pair (n, m)."""
    away = first[:, np.newaxis] - second
    return np.asarray(np.abs(np.arctan2(np.sin(away), np.cos(away))).max(axis=2))


def test_dragging_the_arrow_moves_the_tool_up_and_the_arm_with_it(tab: Tab) -> None:
    before = state_of(tab)
    start, end = np.array(tab.value(HANDLE))
    along = (end - start) / np.linalg.norm(end - start)
    tab.drag(start + 50.0 * along, start + 90.0 * along)
    after = state_of(tab)
    moved = np.array(after["pose"]) - before["pose"]
    assert moved[11] > 0.05  # [m]
    assert np.abs(np.delete(moved, 11)).max() < 1e-12
    solver = solver_of("j2n6s300")
    reached = solver.robot.forward_kinematics(after["q"]).homogeneous.ravel()
    np.testing.assert_allclose(reached, after["pose"], atol=1e-6)
    wanted = solver.solve_all(np.reshape(after["pose"], (4, 4)), seed=after["q"])
    assert len(after["answer"]["branches"]) == len(wanted.q)


def test_fifty_states_have_the_branches_that_python_finds(tab: Tab) -> None:
    rng = np.random.default_rng(44)
    worst = 0.0
    for name, count in STATES.items():
        solver = solver_of(name)
        qs = [q.tolist() for q in solver.robot.sample(rng, count)]
        for q, shown in zip(qs, state_of(tab, SHOW % (json.dumps(qs), json.dumps(name))), strict=True):
            np.testing.assert_allclose(shown["q"], q, atol=1e-9)
            wanted = solver.solve_all(np.reshape(shown["pose"], (4, 4)), seed=shown["q"])
            branches = shown["answer"]["branches"]
            assert len(branches) == len(wanted.q), (name, q)
            assert sum(each["withinLimits"] for each in branches) == int(wanted.within_limits.sum())
            found = np.array([list(each["q"].values()) for each in branches])
            worst = max(worst, float(difference(found, wanted.q).min(axis=1).max()))
    print(f"50 states: worst difference of a branch {worst:.1e} rad")
    assert worst < CLOSE


@pytest.mark.parametrize("name", NAMES)
def test_robots_are_drawn_where_python_has_them(tab: Tab, name: str) -> None:
    robot = jacokin.load_robot(name)
    q = robot.sample(np.random.default_rng(3))
    (shown,) = state_of(tab, SHOW % (json.dumps([q.tolist()]), json.dumps(name)))
    np.testing.assert_allclose(shown["pose"], robot.forward_kinematics(q).homogeneous.ravel(), atol=1e-12)
    assert tab.value("jacokinPlayground.stage.canvas.width") == tab.value("jacokinPlayground.panel.handles.clientWidth")


def test_an_address_keeps_the_state(tab: Tab, site: Path) -> None:
    q = [0.5, 2.5, 1.25, 0.75, 1.5, 2.0]
    state_of(tab, SHOW % (json.dumps([q]), json.dumps("j2s6s300")))
    address = str(tab.value("location.hash"))
    assert address == "#robot=j2s6s300&q=0.5,2.5,1.25,0.75,1.5,2"
    show(tab, site, address, 1000)
    shown = state_of(tab)
    assert shown["robot"] == "j2s6s300"
    np.testing.assert_allclose(shown["q"], q, atol=1e-9)


def test_keys_move_the_tool_and_take_another_solution(tab: Tab) -> None:
    before = state_of(tab)
    tab.value("jacokinPlayground.panel.handles.focus()")
    tab.press_key("PageUp", 33, times=3)
    moved = state_of(tab)
    assert moved["pose"][11] - before["pose"][11] == pytest.approx(0.03)  # [m]
    other = next(i for i, each in enumerate(moved["answer"]["branches"]) if i and each["withinLimits"])
    wanted = np.array(list(moved["answer"]["branches"][other]["q"].values()))
    tab.ask("Input.dispatchKeyEvent", type="keyDown", text=str(other + 1), key=str(other + 1))
    taken = np.array(state_of(tab)["q"])
    assert difference(taken[np.newaxis], wanted[np.newaxis]).max() < 1e-6
    assert state_of(tab)["pose"] == moved["pose"]


def test_it_fits_a_telephone(tab: Tab, site: Path) -> None:
    show(tab, site, "#robot=gen3", 420)
    assert tab.value("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0
