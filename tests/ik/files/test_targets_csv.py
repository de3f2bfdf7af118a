"""CSV files of target poses."""

from __future__ import annotations

from pathlib import Path

import pytest

from jacokin.errors import InvalidInputError
from jacokin.ik import read_targets


def test_binary_targets_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "targets.csv"
    path.write_bytes(b"\xff\xfe\x00x")
    with pytest.raises(InvalidInputError, match="UTF-8"):
        read_targets(path)
