"""Results as one JSON document, for programs."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from enum import Enum

import click


def print_json(document: Mapping[str, object]) -> None:
    """Print one JSON document; floats as the shortest text that reads back the same, infinite ones as null."""
    click.echo(json.dumps(plain(document), indent=2, allow_nan=False))


def plain(value: object) -> object:
    """A value made of what JSON has."""
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):  # numpy arrays and numpy numbers
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
