"""The playground without the site around it, in Chromium.

python -m tests.docs.playground_page        # draws the picture of the README again
"""

from __future__ import annotations

import base64
import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jacokin.model import NAMES
from tests.programs import execute
from tests.scripts import load_script
from tests.viewer.chromium import STARTING, Tab, browsing
from tests.viewer.page import until

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
WEB = ROOT / "integrations" / "web"
PAGE = """<!DOCTYPE html><html lang="en"><meta charset="utf-8"><title>playground</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<link rel="stylesheet" href="playground/playground.css">
<body style="margin: 8px; font: 20px sans-serif" data-md-color-scheme="default" class="md-typeset">
<div id="pg-root" class="pg"></div><p id="pg-keys">keys</p>
<script>globalThis.errors = []; addEventListener("error", (event) => errors.push(event.message));
addEventListener("unhandledrejection", (event) => errors.push(String(event.reason)));</script>
<script src="playground/playground.js" defer></script>"""
PICTURED = "#robot=j2s6s300&q=-0.743,4.528,5.003,-0.901,5.747,-0.234"
READY = "globalThis.jacokinPlayground?.answer?.status"
#: Where the dot of the handles is on the page, and the end of the arrow along z.
HANDLE = """(() => {
  const { camera, pose, panel } = jacokinPlayground;
  const { left, top } = panel.canvas.getBoundingClientRect();
  const at = (up) => {
    const point = [pose[3], pose[7], pose[11] + up];
    const { x, y } = camera.project(point, panel.canvas.clientWidth, panel.canvas.clientHeight);
    return [left + x, top + y];
  };
  return [at(0.0), at(0.1)];
})()"""


def build(folder: Path, names: Sequence[str] = NAMES) -> None:
    """Write `playground.html` and what it needs into a folder."""
    web, scripts, files = folder / "web", folder / "playground", load_script(DOCS / "playground_files.py")
    shutil.copytree(WEB, web, ignore=shutil.ignore_patterns("*.wasm", "robots.js", "reference", "*.tgz"))
    execute(sys.executable, WEB / "build.py", web)
    scripts.mkdir()
    (scripts / "playground.js").write_text(files.page_script(web), encoding="utf-8")
    for name in names:
        (scripts / f"{name}.js").write_text(files.robot_script(name), encoding="utf-8")
    shutil.copy(DOCS / "playground" / "playground.css", scripts)
    (folder / "playground.html").write_text(PAGE, encoding="utf-8")


def show(tab: Tab, site: Path, state: str = "", width: int = 1000) -> None:
    """Open the page at an address's state, some pixels wide and 700 high, until it has its first answer."""
    tab.ask("Emulation.setDeviceMetricsOverride", width=width, height=700, deviceScaleFactor=1, mobile=False)
    tab.ask("Page.navigate", url="about:blank")
    tab.ask("Page.navigate", url=f"{(site / 'playground.html').as_uri()}{state}")
    assert until(lambda: tab.value(READY), STARTING), tab.value("document.body.innerText + errors")


def draw(picture: Path) -> None:
    """Write a PNG of the page at a state with many ghosts."""
    from docs.pictures import keep

    with tempfile.TemporaryDirectory() as name, browsing("about:blank", Path(name) / "chromium", smooth=True) as tab:
        site = Path(name) / "site"
        site.mkdir()
        build(site)
        show(tab, site, PICTURED, width=1200)
        tab.value("jacokinPlayground.settled().then(() => jacokinPlayground.redraw())")
        tab.draw()
        bottom = tab.value("document.querySelector('.pg-main').getBoundingClientRect().bottom + 8")
        clip = {"x": 0, "y": 0, "width": 1200, "height": bottom, "scale": 1}
        shot: Any = tab.ask("Page.captureScreenshot", format="png", clip=clip)["result"]
        drawn = Path(name) / "picture.png"
        drawn.write_bytes(base64.b64decode(shot["data"]))
        keep(drawn, picture)


if __name__ == "__main__":
    draw(DOCS / "images" / "playground.png")
