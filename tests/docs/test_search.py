"""Search of the documentation works where nothing is served: the site is opened from its folder, without a network."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.viewer.chromium import IN_BROWSER, browsing
from tests.viewer.page import until

ROOT = Path(__file__).resolve().parents[2]
FOUND = "[...document.querySelectorAll('.md-search-result__link')].map(link => link.href)"
FOCUSED = "document.activeElement?.classList.contains('md-search__input') === true"
FETCHED = re.compile(r"<(?:script|link|img|iframe)[^>]*(?:src|href)=\"?(https?:[^\"\s>]*)")

pytestmark = IN_BROWSER


def test_a_site_in_a_folder_is_searched(tmp_path: Path) -> None:
    pytest.importorskip("material", reason="the site's theme is not installed (pip install '.[docs]')")
    if not (ROOT / "integrations" / "web" / "jacokin.wasm").exists():
        pytest.skip("the npm package, which is in the site, was not built (python integrations/web/build.py)")
    words = ["mkdocs", "build", "--quiet", "--strict", "--site-dir", str(tmp_path / "site")]
    command = [sys.executable, "-P", "-m", *words]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    subprocess.run(command, cwd=ROOT, env=environment, check=True, capture_output=True)
    with browsing("about:blank", tmp_path / "chromium") as tab:
        for folder in ("", "api/"):
            tab.ask("Page.navigate", url=(tmp_path / "site" / folder / "index.html").as_uri())
            assert until(lambda: tab.value("document.readyState") == "complete")
            for _ in range(10):  # the page may not listen to keys yet
                if tab.value(FOCUSED) is not True:
                    tab.press("S")  # the theme's key for the search box
                if until(lambda: tab.value("typeof __index") == "object", patience=2.0):
                    break
            assert tab.value(FOCUSED) is True
            tab.ask("Input.insertText", text="nearest_reachabl")
            tab.press("E")
            assert until(lambda: tab.value(FOUND))
            found = tab.value(FOUND)
            assert isinstance(found, list)
            assert any("/reachability.html" in link for link in found)
            assert all(link.startswith("file:") for link in found)
    pages = list((tmp_path / "site").rglob("*.html"))
    assert len(pages) > 20
    assert [FETCHED.findall(page.read_text(encoding="utf-8")) for page in pages] == [[]] * len(pages)
