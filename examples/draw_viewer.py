"""Draw the picture on the documentation's page of the viewer: python examples/draw_viewer.py [FILE.png].

Needs the extra `viewer` and Chromium, which runs without a screen.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pinocchio as pin
from PIL import Image

from jacokin import viewer
from jacokin.ik import Box, Scene

PATIENCE = 60.0  # [s]
WIDTH, HEIGHT = 900, 600
EYE, AIM, FOV = np.array([0.9, -1.2, 0.75]), np.array([0.0, -0.1, 0.3]), 0.62
FLAGS = ("--headless=new", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox", "--no-first-run")
BACKGROUND = (255, 255, 255)


def draw(path: Path) -> None:
    """Serve the arm, let Chromium draw it, and save what it drew."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        sys.exit("Chromium is not installed (Debian: apt-get install chromium)")
    scene = Scene([Box("table", (0.4, 0.3, 0.04), (0.25, -0.55, 0.02))])
    with (
        viewer.serve("j2n6s300", scene=scene, collision="report", port=0) as running,
        tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder,
    ):
        page = subprocess.Popen(
            [browser, *FLAGS, f"--window-size={WIDTH},{HEIGHT}", f"--user-data-dir={folder}", running.url],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            end = time.monotonic() + PATIENCE
            while not running.server.get_clients():
                if time.monotonic() > end:
                    sys.exit("the page did not connect")
                time.sleep(0.1)
            client = next(iter(running.server.get_clients().values()))
            client.get_render(HEIGHT, WIDTH, timeout=PATIENCE)  # what is drawn first may lack meshes
            quat = pin.Quaternion(camera())
            wxyz = (quat.w, quat.x, quat.y, quat.z)
            image = client.get_render(
                HEIGHT, WIDTH, wxyz=wxyz, position=EYE, fov=FOV, transport_format="png", timeout=PATIENCE
            )
        finally:
            page.terminate()
            page.wait()
    drawn = Image.fromarray(image)
    picture = Image.new("RGB", drawn.size, BACKGROUND)
    picture.paste(drawn, mask=drawn.getchannel("A"))
    picture.quantize(128).save(path, optimize=True)


def camera() -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """(3, 3) axes of the camera: x right, y down, z forward."""
    forward = (AIM - EYE) / np.linalg.norm(AIM - EYE)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    return np.column_stack((right, np.cross(forward, right), forward))


if __name__ == "__main__":
    draw(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images/viewer.png"))
