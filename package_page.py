"""The page of the package in an index: the README with links that work there. Read by hatchling when it builds.

The address of the repository stands here alone.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

#: PLACEHOLDER: where the repository is. Set it before a release; `make release-check` refuses until then.
REPOSITORY = "https://repository-address.invalid/jacokin"
BRANCH = "main"
#: README begins in a clone; who reads the page in an index has to make one first.
IN_A_CLONE = "python3 -m venv .venv && . .venv/bin/activate  # in a clone\n"
CLONING = f"git clone {REPOSITORY} jacokin && cd jacokin\npython3 -m venv .venv && . .venv/bin/activate\n"


def with_clone(text: str) -> str:
    """README with the command that makes the clone it begins in.

    Raises:
        ValueError: README does not say how to install from a clone.
    """
    if IN_A_CLONE not in text:
        raise ValueError(f"README.md: {IN_A_CLONE!r} is missing")
    return text.replace(IN_A_CLONE, CLONING)


def with_absolute_links(text: str) -> str:
    """A page whose links into the repository, pictures included, are absolute."""
    text = re.sub(r"(!\[[^\]]*\]\()(?!\w+:|#)", rf"\1{REPOSITORY}/raw/{BRANCH}/", text)
    return re.sub(r"((?<!!)\[[^\]]*\]\()(?!\w+:|#)", rf"\1{REPOSITORY}/blob/{BRANCH}/", text)


class CustomMetadataHook(MetadataHookInterface):
    """Fill in what pyproject.toml declares as dynamic."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Add the page and the addresses."""
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        metadata["readme"] = {"content-type": "text/markdown", "text": with_absolute_links(with_clone(text))}
        metadata["urls"] = {
            "Source": REPOSITORY,
            "Documentation": f"{REPOSITORY}/tree/{BRANCH}/docs",
            "Changelog": f"{REPOSITORY}/blob/{BRANCH}/CHANGELOG.md",
            "Issues": f"{REPOSITORY}/issues",
        }
