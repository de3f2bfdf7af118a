"""The table of sizes that the props are made from: `sizes.toml`."""

from __future__ import annotations

import functools
import tomllib
from collections.abc import Mapping
from importlib import resources
from typing import Any


@functools.cache
def load() -> Mapping[str, Any]:
    """The whole table as nested dictionaries; treat it as read-only."""
    return tomllib.loads(resources.files(__package__).joinpath("sizes.toml").read_text(encoding="utf-8"))
