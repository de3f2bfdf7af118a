"""Sets the formulas of the pages as MathML while the site is built, so that pages need no script and no network."""

from __future__ import annotations

import html
import re

from latex2mathml.converter import convert
from mkdocs.structure.pages import Page

#: What `pymdownx.arithmatex` leaves for ``$...$`` and ``$$...$$``.
INLINE = re.compile(r'<span class="arithmatex">\\\((.*?)\\\)</span>', re.DOTALL)
BLOCK = re.compile(r'<div class="arithmatex">\s*\\\[(.*?)\\\]\s*</div>', re.DOTALL)


def on_page_content(content: str, /, *, page: Page, **_: object) -> str:
    """MkDocs calls this with the HTML of each page.

    Raises:
        ValueError: a formula could not be converted; names the page.
    """
    content = INLINE.sub(lambda found: _mathml(found[1], "inline"), content)
    content = BLOCK.sub(lambda found: _mathml(found[1], "block"), content)
    if 'class="arithmatex"' in content:
        raise ValueError(f"{page.file.src_uri}: a formula was not converted to MathML")
    return content


def _mathml(latex: str, display: str) -> str:
    return str(convert(html.unescape(latex).strip(), display=display))
