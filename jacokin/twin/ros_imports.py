"""Imports of ROS, which no package of an index installs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from jacokin.errors import MissingExtraError


@contextmanager
def needed(package: str, install: str) -> Iterator[None]:
    """Around the imports of a version of ROS.

    Args:
        package: its Python package, for errors that name none.
        install: what to do where one is missing.

    Raises:
        MissingExtraError: one is not installed; says what to install.
    """
    try:
        yield
    except ImportError as error:
        raise MissingExtraError(error.name or package, "", command=install) from error
