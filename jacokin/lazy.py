"""Packages whose public names load their modules when first used (PEP 562)."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable


def door(package: str, file: str) -> tuple[list[str], Callable[[str], object], Callable[[], list[str]]]:
    """The `__all__`, `__getattr__` and `__dir__` of a package that imports nothing until it is asked.

    The stub beside the package, which type checkers read, says which names are public and where each comes from, in
    lines "from module import name as name"; a name that comes from the package itself is a module of it.

    Args:
        package: name of the package, its `__name__`.
        file: its `__file__`.

    Returns:
        The sorted public names; a function that loads one of them; a function that lists them.
    """
    with open(f"{file}i", encoding="utf-8") as stub:  # noqa: PTH123 - pathlib takes longer to load than this package
        lines = [line.split() for line in stub if line.startswith("from ")]
    module_of = {name: module for _, module, _, name, *_ in lines}
    public = sorted(module_of)

    def load(name: str) -> object:
        module = module_of.get(name)
        if module is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}; public names: {', '.join(public)}")
        if module == package:
            value: object = importlib.import_module(f"{module}.{name}")
        else:
            value = getattr(importlib.import_module(module), name)
        setattr(sys.modules[package], name, value)
        return value

    return public, load, lambda: list(public)
