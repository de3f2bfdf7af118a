"""Chromium without a screen, and what its pictures should show."""

from __future__ import annotations

import contextlib
import json
import math
import shutil
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from websockets.sync.client import connect
from websockets.sync.connection import Connection

from jacokin.arrays import Array
from jacokin.model import poses
from jacokin.viewer import Viewer
from jacokin.viewer.drawing import ArmPart
from jacokin.viewer.view import ShownPlaces
from tests.viewer.page import until

Mask = NDArray[np.bool_]

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
IN_BROWSER = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed (Debian: apt-get install chromium)"),
]
WITHOUT_SCREEN = (
    "--headless=new",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-sandbox",
    "--no-first-run",
    "--disable-dev-shm-usage",
    "--window-size=1000,700",
    "--remote-debugging-port=0",
)
ROUGH = "--webgl-antialiasing-mode=none"  # the processor draws, and smooth edges are a third of that
STARTING = 60.0  # [s]

TEXTS = """const same = e => e.textContent.trim() === %s;
  const texts = [...document.querySelectorAll('body *')].filter(e => same(e) && ![...e.children].some(same));"""
# Of the texts that are alike, the one whose nearest surroundings hold exactly one slider.
SLIDER = f"""(() => {{ {TEXTS}
  for (const text of texts) {{
    for (let around = text, up = 0; around && up < 6; around = around.parentElement, up++) {{
      const found = around.querySelectorAll('[role=slider]');
      if (found.length === 1) {{ found[0].scrollIntoView(); found[0].focus(); return true; }}
      if (found.length > 1) break;
    }}
  }}
  return false;
}})()"""
FRAMES = "(async () => { for (let i = 0; i < %d; i++) await new Promise(requestAnimationFrame); })()"
PLACE = f"""(async () => {{ {TEXTS}
  await new Promise(resolve => setTimeout(resolve, 100));
  for (let frame = 0; frame < 2; frame++) await new Promise(requestAnimationFrame);
  const text = texts[0];
  if (!text) return null;
  const input = text.closest('label')?.control;
  const found = input?.type === 'checkbox' ? input : text;
  found.scrollIntoView({{block: 'center'}});
  const box = found.getBoundingClientRect();
  return [box.x + box.width / 2, box.y + box.height / 2];
}})()"""

WIDTH, HEIGHT, FOV = 480, 360, 0.8
EYE, AIM = np.array([1.3, -1.3, 1.0]), np.array([0.0, 0.0, 0.35])


class Tab:
    """A page of the viewer in Chromium, driven by its own mouse and keys."""

    def __init__(self, socket: Connection) -> None:
        self._socket = socket
        self._sent = 0

    def ask(self, method: str, **parameters: object) -> dict[str, object]:
        """Call Chromium's debugging interface and wait for its answer."""
        self._sent += 1
        self._socket.send(json.dumps({"id": self._sent, "method": method, "params": parameters}))
        while True:
            answer: dict[str, object] = json.loads(self._socket.recv(timeout=STARTING))
            if answer.get("id") == self._sent:
                assert "error" not in answer, answer
                return answer

    def press(self, letter: str) -> None:
        code = {"key": letter.lower(), "code": f"Key{letter}", "windowsVirtualKeyCode": ord(letter)}
        self.ask("Input.dispatchKeyEvent", type="keyDown", text=letter.lower(), **code)
        self.ask("Input.dispatchKeyEvent", type="keyUp", **code)

    def press_key(self, key: str, code: int, times: int = 1) -> None:
        """A key without a letter, for what has the focus."""
        for _ in range(times):
            for kind in ("keyDown", "keyUp"):
                self.ask("Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=code)

    def focus_slider(self, label: str) -> None:
        """Give the focus to the slider of the panel beside a text."""
        assert until(lambda: self.value(SLIDER % json.dumps(label)), STARTING), f"no slider {label}"

    def draw(self, frames: int = 3) -> None:
        """Wait until the page has drawn some frames: it has then answered what it was sent before."""
        self.value(FRAMES % frames)

    def click(self, label: str) -> None:
        """Click on the check box beside a text, or on the text."""
        before, place = None, self.value(PLACE % json.dumps(label))
        end = time.monotonic() + STARTING
        while place != before or place in (None, [0, 0]):  # folders open slowly
            assert time.monotonic() < end, f"no {label} that keeps still"
            time.sleep(0.15)
            before, place = place, self.value(PLACE % json.dumps(label))
        assert isinstance(place, list)
        at = np.array(place)
        self._mouse("mouseMoved", at, "none")
        self._mouse("mousePressed", at, "left")
        self._mouse("mouseReleased", at, "left")

    def drag(self, start: Array, end: Array, steps: int = 8) -> None:
        """Hold the left button from one pixel to another."""
        self._mouse("mouseMoved", start, "none")
        self.draw()  # the page looks at what is under the mouse once a frame
        self._mouse("mousePressed", start, "left")
        for step in range(1, steps + 1):
            self._mouse("mouseMoved", start + (end - start) * step / steps, "left")
            self.draw(1)
        self._mouse("mouseReleased", end, "left")

    def value(self, script: str) -> object:
        """What a script in the page comes to, promises included."""
        answer = self.ask("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)["result"]
        assert isinstance(answer, dict)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def _mouse(self, kind: str, at: Array, button: str) -> None:
        self.ask("Input.dispatchMouseEvent", type=kind, x=float(at[0]), y=float(at[1]), button=button, clickCount=1)


@contextlib.contextmanager
def browsing(url: str, folder: Path, *, smooth: bool = False) -> Iterator[Tab]:
    """A browser of its own that opens a page, with its files in a folder; with smooth edges for pictures to look at."""
    assert CHROMIUM is not None
    command = [CHROMIUM, *WITHOUT_SCREEN, *([] if smooth else [ROUGH]), f"--user-data-dir={folder}", url]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        listening = folder / "DevToolsActivePort"
        assert until(lambda: listening.exists() and listening.read_text(encoding="utf-8").count("\n"), STARTING)
        port = listening.read_text(encoding="utf-8").split()[0]
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json", timeout=STARTING) as listed:
            (address,) = [item["webSocketDebuggerUrl"] for item in json.load(listed) if item["type"] == "page"]
        with connect(address, max_size=None) as socket:
            yield Tab(socket)
    finally:
        process.terminate()
        process.wait(timeout=STARTING)


@contextlib.contextmanager
def showing(viewer: Viewer, folder: Path) -> Iterator[Tab]:
    """A browser of its own that shows the viewer."""
    known = set(viewer.server.get_clients())
    with browsing(viewer.url, folder) as tab:
        assert until(lambda: set(viewer.server.get_clients()) - known, STARTING), "the page did not connect"
        assert until(lambda: tab.value("document.querySelectorAll('[role=slider]').length"), STARTING), "no panel"
        told = viewer.server.initial_camera.position

        def placed() -> bool:
            """A page first says where it looks by itself, then where it was told to."""
            pages = [page for number, page in viewer.server.get_clients().items() if number not in known]
            return any(np.allclose(page.camera.position, told) for page in pages)

        assert until(placed, STARTING), "the camera is not in its place"
        yield tab


@contextlib.contextmanager
def hidden(viewer: Viewer, *names: str) -> Iterator[None]:
    """Without some nodes of the scene, which would be in the pictures."""
    nodes = [viewer.server.scene.get_handle_by_name(name) for name in names]
    gone = [node for node in nodes if node is not None and node.visible]
    for node in gone:
        node.visible = False
    try:
        yield
    finally:
        for node in gone:
            node.visible = True


def camera() -> Array:
    """(3, 3) axes of the camera at EYE: x right, y down, z forward."""
    forward = (AIM - EYE) / np.linalg.norm(AIM - EYE)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return np.column_stack((right, np.cross(forward, right), forward))


def pixels(points: Array, axes: Array, eye: Array, fov: float, width: int, height: int) -> Array:
    """(n, 2) where points (n, 3) are in a picture."""
    seen = (points - eye) @ axes
    scale = 0.5 * height / math.tan(0.5 * fov)
    return np.column_stack((0.5 * width, 0.5 * height)) + scale * seen[:, :2] / seen[:, 2:]


def silhouette(parts: tuple[ArmPart, ...], places: ShownPlaces, arm: int, first: int = 0) -> Mask:
    """The pixels that one of the placed arms covers, from part `first` on."""
    picture = Image.new("1", (WIDTH, HEIGHT))
    draw = ImageDraw.Draw(picture)
    for part, position, quat in list(zip(parts, places.positions[arm], places.wxyzs[arm], strict=True))[first:]:
        if part.mesh is None:
            continue
        w, x, y, z = (float(value) for value in quat)
        rotation = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        corners = pixels(part.mesh.vertices @ rotation.T + position, camera(), EYE, FOV, WIDTH, HEIGHT)
        for face in part.mesh.faces:
            draw.polygon([(float(u), float(v)) for u, v in corners[face]], fill=1)
    return np.array(picture)


def picture(viewer: Viewer, page: int = 0) -> Mask:
    """The pixels where a page draws anything."""
    return np.asarray(image(viewer, page)[:, :, 3] > 0)


def image(viewer: Viewer, page: int = 0) -> NDArray[np.uint8]:
    """(HEIGHT, WIDTH, 4) what a page draws: red, green, blue, and how opaque it is."""
    client = list(viewer.server.get_clients().values())[page]
    wxyz = poses.quaternion(camera())
    return client.get_render(HEIGHT, WIDTH, wxyz=wxyz, position=EYE, fov=FOV, transport_format="png", timeout=STARTING)


def agreement(first: Mask, second: Mask) -> float:
    """Pixels that two masks share, of those that either has."""
    return float((first & second).sum() / max(int((first | second).sum()), 1))
