"""Draw the pictures on the documentation's page of the viewer: python examples/draw_viewer.py [FOLDER].

Needs the extra `viewer` and Chromium, which runs without a screen.
"""

from __future__ import annotations

import base64
import contextlib
import io
import json
import shutil
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from PIL import Image
from websockets.sync.client import connect

from jacokin import pose, viewer
from jacokin.ik import Box, Scene

PATIENCE = 60.0  # [s]
SETTLING = 3.0  # [s] of a page that was just opened, or clicked on
DISMISS = "document.querySelector('.mantine-Notification-closeButton')?.click()"  # drawing takes no graphics card
WINDOW = "1100,1000"  # [pixel]
CLICK = """(() => {
  const texts = [...document.querySelectorAll('body *')].filter(e => e.textContent.trim() === '%s');
  const text = texts[texts.length - 1];
  (text.closest('label')?.control ?? text).click();
})()"""
WIDTH, HEIGHT = 900, 600
EYE, AIM, FOV = np.array([0.9, -1.2, 0.75]), np.array([0.0, -0.1, 0.3]), 0.62
FLAGS = ("--headless=new", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox", "--no-first-run")
BACKGROUND = (255, 255, 255)


def main(folder: Path) -> None:
    """The arm with its branches; and a page with its panel: a slice of the map, a free axis, contact."""
    scene = Scene([Box("table", (0.4, 0.3, 0.04), (0.25, -0.55, 0.02))])
    with (
        viewer.serve("j2n6s300", viewer.ViewerOptions(collision="report"), scene=scene, port=0) as running,
        page_of(running),
    ):
        client = next(iter(running.server.get_clients().values()))
        client.get_render(HEIGHT, WIDTH, timeout=PATIENCE)  # what is drawn first may lack meshes
        quat = pin.Quaternion(camera())
        wxyz = (quat.w, quat.x, quat.y, quat.z)
        image = client.get_render(
            HEIGHT, WIDTH, wxyz=wxyz, position=EYE, fov=FOV, transport_format="png", timeout=PATIENCE
        )
    drawn = Image.fromarray(image)
    picture = Image.new("RGB", drawn.size, BACKGROUND)
    picture.paste(drawn, mask=drawn.getchannel("A"))
    picture.quantize(128).save(folder / "viewer.png", optimize=True)

    crate = Scene([Box("crate", (0.12, 0.12, 0.12), (0.25, -0.3, 0.3))])
    target = pose([0.25, -0.3, 0.38], down=True)
    options = viewer.ViewerOptions(collision="report", free_axis="z")
    with (
        viewer.serve("j2n6s300", options, scene=crate, target=target, port=0) as running,
        page_of(running) as ask,
    ):
        client = next(iter(running.server.get_clients().values()))
        client.camera.position, client.camera.look_at = (1.0, -1.3, 0.9), (0.25, 0.05, 0.25)
        ask("Runtime.evaluate", expression=DISMISS)
        ask("Runtime.evaluate", expression=CLICK % "Reachability map")
        time.sleep(SETTLING)
        ask("Runtime.evaluate", expression=CLICK % "Slice")
        time.sleep(SETTLING)
        content = ask("Page.captureScreenshot")["data"]
    with Image.open(io.BytesIO(base64.b64decode(content))) as page:
        page.convert("RGB").quantize(256).save(folder / "viewer_map.png", optimize=True)


@contextlib.contextmanager
def page_of(running: viewer.Viewer) -> Iterator[Callable[..., dict[str, Any]]]:  # Any: JSON of Chromium
    """Chromium with the page of a viewer; yields a function that asks Chromium."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        sys.exit("Chromium is not installed (Debian: apt-get install chromium)")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder = Path(name)
        words = [*FLAGS, f"--window-size={WINDOW}", "--remote-debugging-port=0", f"--user-data-dir={folder}"]
        process = subprocess.Popen([browser, *words, running.url], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            end = time.monotonic() + PATIENCE
            while not running.server.get_clients():
                if time.monotonic() > end:
                    sys.exit("the page did not connect")
                time.sleep(0.1)
            time.sleep(SETTLING)
            port = (folder / "DevToolsActivePort").read_text(encoding="utf-8").split()[0]
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/json", timeout=PATIENCE) as listed:
                address = next(each["webSocketDebuggerUrl"] for each in json.load(listed) if each["type"] == "page")
            with connect(address, max_size=None) as socket:

                def ask(method: str, **parameters: object) -> dict[str, Any]:  # Any: as above
                    socket.send(json.dumps({"id": 1, "method": method, "params": parameters}))
                    return dict(json.loads(socket.recv(timeout=PATIENCE))["result"])

                yield ask
        finally:
            process.terminate()
            process.wait()


def camera() -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """(3, 3) axes of the camera: x right, y down, z forward."""
    forward = (AIM - EYE) / np.linalg.norm(AIM - EYE)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return np.column_stack((right, np.cross(forward, right), forward))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images"))
