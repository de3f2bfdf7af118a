"""A path of two poses in a file."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture
def path_file(tmp_path: Path) -> Path:
    """Ten centimetres to the right with the tool down."""
    path = tmp_path / "path.csv"
    half = 0.5**0.5
    rows = [f"{x},-0.2,0.5,0,{half!r},{half!r},0" for x in (0.3, 0.4)]
    path.write_text("\n".join(["x,y,z,qw,qx,qy,qz", *rows]) + "\n", encoding="utf-8")
    return path
