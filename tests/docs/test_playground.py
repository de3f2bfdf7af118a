"""The playground of the documentation in Chromium, opened from a folder: what it shows is what Python answers."""

from __future__ import annotations

import base64
import functools
import importlib.util
import json
import math
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import jacokin
from jacokin.arrays import Array
from jacokin.ik import IKSolver, export_c
from tests.docs.playground_page import DOCS, HANDLE, build, show
from tests.robot_files import ur5_text
from tests.viewer.chromium import IN_BROWSER, Tab, browsing
from tests.viewer.page import until

NAMES = ("j2n6s300", "j2s6s300", "m1n6s200", "gen3_lite", "gen3_6dof", "j2s7s300", "gen3")
#: States that are compared with Python's answers, of arms with six joints.
STATES = {"j2n6s300": 20, "j2s6s300": 10, "gen3_lite": 10, "m1n6s200": 10}
CLOSE = 1e-9  # [rad] between the same branch here and there: a well conditioned one agrees to 1e-12
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
#: Takes what goes to the clipboard.
CATCH = """Object.defineProperty(navigator, "clipboard", {
  value: { writeText: async (text) => (globalThis.copied = text) },
})"""
CLICK = """(async () => {
  [...document.querySelectorAll(".pg-share button")].find((each) => each.textContent === "%s").click();
  await Promise.resolve();
  return copied;
})()"""
#: What the stage was told to draw in a frame: calls, and triangles.
COUNT = """(() => {
  const { stage } = jacokinPlayground;
  const gl = stage.canvas.getContext("webgl2");
  const draw = stage.draw.bind(stage);
  globalThis.drawn = [];
  stage.draw = (camera, scene) => {
    drawn.push({ calls: 0, triangles: 0, ghosts: scene.ghosts.length, coarse: scene.coarse });
    draw(camera, scene);
  };
  const count = (name, triangles) => {
    const call = gl[name].bind(gl);
    gl[name] = (...all) => (drawn.at(-1).calls++, (drawn.at(-1).triangles += triangles(...all)), call(...all));
  };
  count("drawArrays", () => 0); // lines
  count("drawElements", (mode, corners) => corners / 3);
  count("drawElementsInstanced", (mode, corners, type, offset, times) => (corners / 3) * times);
})()"""
#: Pixels to one of the page while frames take 100 ms, while they take 5 ms, at rest, and while they take 5 ms.
PACE = """(() => {
  const pace = new jacokinPlayground.pace.constructor();
  let now = 0;
  const take = (frames, time) => Array.from({ length: frames }, () => pace.sharpness((now += time), false)).at(-1);
  const told = [];
  const tell = (sharpness) => told.push([sharpness, pace.coarse]);
  tell(take(9, 100));
  tell(take(99, 5));
  tell(pace.sharpness(now, true));
  tell(take(99, 5));
  return told;
})()"""
#: Opens a file (its name, its bytes in base64) as by the button, and by dropping it on the arm.
OPEN = {
    "button": """(async (name, text) => {
  const held = new DataTransfer();
  held.items.add(new File([Uint8Array.from(atob(text), (each) => each.charCodeAt(0))], name));
  const input = document.querySelector(".pg-bar input[type=file]");
  input.files = held.files;
  input.dispatchEvent(new Event("change"));
})(%s, %s)""",
    "drop": """(async (name, text) => {
  const dataTransfer = new DataTransfer();
  dataTransfer.items.add(new File([Uint8Array.from(atob(text), (each) => each.charCodeAt(0))], name));
  jacokinPlayground.panel.canvas.dispatchEvent(new DragEvent("drop", { dataTransfer, cancelable: true }));
})(%s, %s)""",
}
STATE = "jacokinPlayground.settled().then(() => jacokinPlayground.state())"

pytestmark = [
    *IN_BROWSER,
    pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="ziglang is not installed"),
]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page with nothing around it."""
    folder = tmp_path_factory.mktemp("site")
    build(folder, NAMES)
    return folder


@pytest.fixture(scope="module")
def browser(site: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    with browsing("about:blank", tmp_path_factory.mktemp("chromium")) as tab:
        yield tab


@pytest.fixture
def tab(browser: Tab, site: Path) -> Iterator[Tab]:
    """The page anew, 1000 x 700 pixels; no script of it may fail."""
    show(browser, site)
    yield browser
    assert browser.value("errors") == []


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


def test_a_slow_machine_draws_few_triangles_while_it_drags(tab: Tab) -> None:
    state_of(tab)
    tab.value(COUNT)
    tab.value("jacokinPlayground.pace.coarse = true")
    start, end = np.array(tab.value(HANDLE))
    tab.drag(start + 0.5 * (end - start), start + 0.9 * (end - start))
    state_of(tab)
    tab.value("jacokinPlayground.redraw()")
    tab.draw()
    frames: Any = tab.value("drawn")
    moving, still = ([frame for frame in frames if frame["coarse"] is coarse] for coarse in (True, False))
    assert max(frame["ghosts"] for frame in moving) >= 5
    assert max(frame["calls"] for frame in moving) <= 30
    assert max(frame["triangles"] for frame in moving) <= 15_000
    assert still[-1]["triangles"] > 50_000  # with all details


def test_a_slow_machine_draws_few_pixels_until_the_page_is_at_rest(tab: Tab) -> None:
    assert tab.value(PACE) == [[0.5, True], [1, True], [2, False], [2, False]]


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
    sharpness = "jacokinPlayground.stage.canvas.width / jacokinPlayground.panel.canvas.clientWidth"
    assert until(lambda: tab.value(sharpness) == 2)  # what is at rest is drawn with all pixels


def test_an_address_keeps_the_state(tab: Tab, site: Path) -> None:
    q = [0.5, 2.5, 1.25, 0.75, 1.5, 2.0]
    state_of(tab, SHOW % (json.dumps([q]), json.dumps("j2s6s300")))
    address = str(tab.value("location.hash"))
    assert address == "#robot=j2s6s300&q=0.5,2.5,1.25,0.75,1.5,2"
    show(tab, site, address)
    shown = state_of(tab)
    assert shown["robot"] == "j2s6s300"
    np.testing.assert_allclose(shown["q"], q, atol=1e-9)


def test_keys_move_the_tool_and_take_another_solution(tab: Tab) -> None:
    before = state_of(tab)
    tab.value("jacokinPlayground.panel.canvas.focus()")
    tab.press_key("PageUp", 33, times=3)
    moved = state_of(tab)
    assert moved["pose"][11] - before["pose"][11] == pytest.approx(0.03)  # [m]
    other = next(i for i, each in enumerate(moved["answer"]["branches"]) if i and each["withinLimits"])
    wanted = np.array(list(moved["answer"]["branches"][other]["q"].values()))
    tab.ask("Input.dispatchKeyEvent", type="keyDown", text=str(other + 1), key=str(other + 1))
    taken = np.array(state_of(tab)["q"])
    assert difference(taken[np.newaxis], wanted[np.newaxis]).max() < 1e-6
    assert state_of(tab)["pose"] == moved["pose"]


def test_a_joint_moves_the_target_with_the_arm(tab: Tab) -> None:
    q = state_of(tab)["q"]
    tab.value("document.querySelector('.pg-joints input').focus()")
    tab.press_key("ArrowRight", 39, times=2)
    moved = state_of(tab)
    assert moved["q"][0] - q[0] == pytest.approx(math.radians(2.0), abs=1e-6)
    reached = solver_of("j2n6s300").robot.forward_kinematics(moved["q"]).homogeneous.ravel()
    np.testing.assert_allclose(moved["pose"], reached, atol=1e-9)


def test_a_target_out_of_reach_leaves_the_arm_and_says_so(tab: Tab) -> None:
    q = state_of(tab)["q"]
    tab.value("jacokinPlayground.setPose([1, 0, 0, 3, 0, 1, 0, 0, 0, 0, 1, 0.5, 0, 0, 0, 1])")
    far = state_of(tab)
    assert far["answer"]["status"] == "unreachable"
    np.testing.assert_allclose(far["q"], q, atol=0.0)
    assert "pose=3,0,0.5,0,0,0" in str(tab.value("location.hash"))
    assert tab.value("document.querySelector('.pg-status').classList.contains('pg-bad')") is True


def test_a_free_axis_has_the_intervals_that_python_finds(tab: Tab) -> None:
    tab.value("jacokinPlayground.setFree('y')")
    shown = state_of(tab)
    target = jacokin.FreeAxis(np.reshape(shown["pose"], (4, 4)), axis=(0.0, 1.0, 0.0))
    wanted = solver_of("j2n6s300").solve_all(target).intervals
    curves = shown["answer"]["curves"]
    assert len(curves) == len(wanted) > 0
    for curve, interval in zip(curves, wanted, strict=True):
        assert curve["start"] == pytest.approx(interval.start, abs=1e-6)
        assert curve["stop"] == pytest.approx(interval.stop, abs=1e-6)
    assert tab.value("document.querySelectorAll('.pg-curve').length") == len(curves)
    assert "&free=y" in str(tab.value("location.hash"))


def test_sliding_along_the_set_keeps_the_tool_where_it_is(tab: Tab, site: Path) -> None:
    show(tab, site, "#robot=j2s7s300")
    before = state_of(tab)
    tab.value("document.querySelector('.pg-slide input').focus()")
    tab.press_key("ArrowRight", 39, times=3)
    after = state_of(tab)
    assert after["pose"] == before["pose"]
    assert np.abs(np.subtract(after["q"], before["q"])).max() > 0.01  # [rad]
    reached = solver_of("j2s7s300").robot.forward_kinematics(after["q"]).homogeneous.ravel()
    np.testing.assert_allclose(reached, after["pose"], atol=2e-6)


@pytest.mark.parametrize("state", ["#robot=j2n6s300", "#robot=j2n6s300&free=z", "#robot=j2s7s300"])
def test_copied_programs_ask_for_what_is_shown(tab: Tab, site: Path, tmp_path: Path, state: str) -> None:
    show(tab, site, state)
    shown = state_of(tab)
    tab.value(CATCH)
    program, c = (str(tab.value(CLICK % label)) for label in ("Copy as Python", "Copy as C"))
    names: dict[str, Any] = {}
    exec(program, names)
    assert names["result"].success
    np.testing.assert_allclose(names["result"].q, shown["q"], atol=1e-6)
    if shutil.which("cc") is None:
        pytest.skip("there is no C compiler")
    export_c(solver_of(shown["robot"]), tmp_path / "arm")
    (tmp_path / "program.c").write_text(c, encoding="utf-8")
    folder = tmp_path / "arm"
    words = ["cc", "-std=c99", "-Wall", "-Werror", "program.c", f"-I{folder}/include", f"-L{folder}/lib", "-ljacokin"]
    subprocess.run([*words, f"-Wl,-rpath,{folder}/lib", "-o", "program"], cwd=tmp_path, check=True)
    said = subprocess.run(["./program"], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    angles = [[float(word) for word in line.split(":")[1].split()] for line in said.splitlines() if ":" in line]
    assert len(angles) == max(len(shown["answer"]["branches"]), 1)
    np.testing.assert_allclose(angles[0], shown["q"], atol=1e-6)


def opened(tab: Tab, how: str, name: str, contents: bytes) -> None:
    tab.value(OPEN[how] % (json.dumps(name), json.dumps(base64.b64encode(contents).decode())))


@pytest.mark.parametrize("how", OPEN)
def test_an_arm_of_ones_own_is_opened_by_its_solver_file(tab: Tab, tmp_path: Path, how: str) -> None:
    (tmp_path / "mine.urdf").write_text(ur5_text(), encoding="utf-8")
    solver = IKSolver(jacokin.load_robot(tmp_path / "mine.urdf"), collision="ignore")
    opened(tab, how, "mine.jacokin", export_c(solver, tmp_path / "arm").read_bytes())
    assert until(lambda: tab.value("jacokinPlayground.robot.name") == "mine.jacokin")
    home = state_of(tab)
    np.testing.assert_allclose(home["q"], solver.robot.home)
    qs = [q.tolist() for q in solver.robot.sample(np.random.default_rng(5), 5)]
    for q, shown in zip(qs, state_of(tab, SHOW % (json.dumps(qs), '"mine.jacokin"')), strict=True):
        reached = solver.robot.forward_kinematics(q).homogeneous
        np.testing.assert_allclose(shown["pose"], reached.ravel(), atol=1e-9)
        wanted = solver.solve_all(reached, seed=q)
        found = np.array([list(each["q"].values()) for each in shown["answer"]["branches"]])
        assert len(found) == len(wanted.q)
        assert difference(found, wanted.q).min(axis=1).max() < CLOSE
    tab.value(CATCH)
    assert 'load_robot("mine.urdf", base="l0", tip="l6")' in str(tab.value(CLICK % "Copy as Python"))
    assert "arm/mine.jacokin" in str(tab.value(CLICK % "Copy as C"))


def test_seven_joints_of_ones_own_are_drawn_and_have_their_curves(tab: Tab, tmp_path: Path) -> None:
    solver = solver_of("gen3")
    opened(tab, "button", "other name", export_c(solver, tmp_path).read_bytes())
    assert until(lambda: tab.value("jacokinPlayground.robot.name") == "other name.jacokin")
    q = solver.robot.sample(np.random.default_rng(6)).tolist()
    (shown,) = state_of(tab, SHOW % (json.dumps([q]), '"other name.jacokin"'))
    pose = solver.robot.forward_kinematics(q)
    np.testing.assert_allclose(shown["pose"], pose.homogeneous.ravel(), atol=1e-9)
    assert len(shown["answer"]["curves"]) == len(solver.solve_all(pose).intervals)
    assert "other" not in str(tab.value("location.hash"))  # another page does not have the file


def test_a_file_that_is_not_a_solver_is_refused(tab: Tab) -> None:
    before = state_of(tab)
    opened(tab, "button", "picture.jacokin", b"not this")
    said = "document.querySelector('.pg-status').textContent"
    assert until(lambda: "picture.jacokin is not opened" in str(tab.value(said)))
    assert state_of(tab) == before


def test_everything_that_is_used_has_a_name(tab: Tab, site: Path) -> None:
    show(tab, site, "#robot=gen3")
    state_of(tab)
    tree: Any = tab.ask("Accessibility.getFullAXTree")["result"]
    used = ("button", "combobox", "slider", "spinbutton", "checkbox", "application", "image", "img")
    found = [node for node in tree["nodes"] if not node["ignored"] and node["role"]["value"] in used]
    assert {node["role"]["value"] for node in found} > {"button", "combobox", "slider", "spinbutton", "application"}
    assert [node for node in found if not node["name"]["value"].strip()] == []


def test_the_arm_jumps_where_motion_is_not_wanted(tab: Tab) -> None:
    tab.ask("Emulation.setEmulatedMedia", features=[{"name": "prefers-reduced-motion", "value": "reduce"}])
    try:
        assert tab.value("(() => { const page = jacokinPlayground; page.choose(2); return page.shown === page.q; })()")
    finally:
        tab.ask("Emulation.setEmulatedMedia", features=[])


def test_it_fits_a_telephone(tab: Tab, site: Path) -> None:
    show(tab, site, "#robot=gen3", width=420)
    assert tab.value("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0


def test_colours_can_be_told_apart() -> None:
    """WCAG AA: texts 4.5, marks 3."""
    css = (DOCS / "playground" / "playground.css").read_text(encoding="utf-8")
    light, dark = (dict(re.findall(r"--pg-(\w+): (#\w+);", block)) for block in css.split("\n}\n")[:2])
    for colours, page in ((light, "#ffffff"), (dark, "#1e2129")):
        for back in (colours["back"], colours["raised"], page):
            assert min(contrast(colours[text], back) for text in ("text", "dim")) >= 4.5
            assert min(contrast(colours[mark], back) for mark in ("within", "outside", "bad", "accent")) >= 3.0
        assert contrast(colours["control"], page) >= 3.0


def contrast(first: str, second: str) -> float:
    """By WCAG 2.2: of two colours such as `#fff`."""

    def luminance(colour: str) -> float:
        digits = colour[1:] if len(colour) == 7 else "".join(2 * digit for digit in colour[1:])
        parts = [int(digits[i : i + 2], 16) / 255.0 for i in (0, 2, 4)]
        linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
        return float(np.dot(linear, (0.2126, 0.7152, 0.0722)))

    dark, light = sorted((luminance(first), luminance(second)))
    return (light + 0.05) / (dark + 0.05)
