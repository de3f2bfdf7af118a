"""The npm package, built and tried in Node and in Chromium; `integrations/web/test` has what it answers."""

from __future__ import annotations

import functools
import gzip
import http.server
import json
import os
import queue
import re
import shutil
import subprocess
import sys
import threading
from importlib.util import find_spec
from pathlib import Path
from typing import ClassVar

import pytest

import jacokin
from tests.programs import execute
from tests.viewer.chromium import CHROMIUM, STARTING, WITHOUT_SCREEN
from tests.web import reference

WEB = Path(__file__).parents[2] / "integrations" / "web"
#: [bytes] of the WebAssembly as servers send it.
LARGEST = 700_000
PAGE = """<!DOCTYPE html><title>jacokin</title><script type="module">
import { load } from "./jacokin.js";
const solver = await load("gen3_lite");
const worker = new Worker(URL.createObjectURL(new Blob([`
  import(${JSON.stringify(new URL("./jacokin.js", location))}).then(async ({ load }) => {
    const solver = await load("gen3");
    postMessage(solver.nearest(solver.fk(solver.home)).status);
  }).catch((error) => postMessage(String(error)));`])));
const there = await new Promise((resolve) => (worker.onmessage = ({ data }) => resolve(data)));
await fetch(`/said?here:${solver.nearest(solver.fk(solver.home)).status},there:${there}`);
</script>"""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        shutil.which("npm") is None, reason="Node is not installed (Debian: apt-get install nodejs npm)"
    ),
    pytest.mark.skipif(find_spec("ziglang") is None, reason="ziglang is not installed"),
]


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package as it is built, in a folder of its own."""
    folder = tmp_path_factory.mktemp("npm") / "jacokin"
    shutil.copytree(WEB, folder, ignore=shutil.ignore_patterns("*.wasm", "robots.js", "LICENSE*", "reference", "*.tgz"))
    execute(sys.executable, WEB / "build.py", folder)
    return folder


def test_node_answers_as_the_native_library_does(package: Path, tmp_path: Path) -> None:
    reference.write(tmp_path)
    environment = {**os.environ, "JACOKIN_REFERENCE": f"{tmp_path.as_uri()}/"}
    words = ["node", "--test"]
    done = subprocess.run(words, cwd=package, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert "\n# skipped 0\n" in done.stdout


def test_npm_packs_what_runs_and_no_more(package: Path) -> None:
    words = ["npm", "pack", "--dry-run", "--json", "--offline"]
    done = subprocess.run(words, cwd=package, capture_output=True, text=True, check=True)
    (packed,) = json.loads(done.stdout)
    assert packed["version"] == jacokin.__version__
    assert {file["path"] for file in packed["files"]} == {
        *("package.json", "README.md", "LICENSE", "LICENSE-libc", "NOTICE"),
        *("jacokin.js", "jacokin.d.ts", "jacokin.wasm", "robots.js"),
    }
    about = json.loads((package / "package.json").read_text(encoding="utf-8"))
    assert not any(name.lower().endswith("dependencies") for name in about)
    size = len(gzip.compress((package / "jacokin.wasm").read_bytes()))
    assert size <= LARGEST
    pages = (package / "README.md", WEB.parents[1] / "docs" / "web.md")
    told = [re.search(r"(\d+) kB (with gzip|compressed)", page.read_text(encoding="utf-8")) for page in pages]
    assert [each is not None and abs(1e3 * int(each[1]) / size - 1.0) < 0.1 for each in told] == [True, True]


@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed (Debian: apt-get install chromium)")
def test_a_page_in_chromium_solves_here_and_in_a_worker(package: Path, tmp_path: Path) -> None:
    (package / "page.html").write_text(PAGE, encoding="utf-8")
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(_Site, directory=str(package))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        words = [str(CHROMIUM), *WITHOUT_SCREEN, f"--user-data-dir={tmp_path}"]
        words += ["--disable-background-networking", "--disable-component-update"]
        page = f"http://127.0.0.1:{server.server_port}/page.html"
        browser = subprocess.Popen([*words, page], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            assert _Site.said.get(timeout=STARTING) == "/said?here:ok,there:ok"
        finally:
            browser.terminate()
            browser.wait()
            server.shutdown()


class _Site(http.server.SimpleHTTPRequestHandler):
    """Serves the package, and takes down what its page says at the end."""

    said: ClassVar[queue.Queue[str]] = queue.Queue()

    def do_GET(self) -> None:
        """A file, or what the page says."""
        if self.path.startswith("/said?"):
            self.said.put(self.path)
        super().do_GET()

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the base class has this name
        """Nothing."""
