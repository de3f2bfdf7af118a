"""Packages whose public names load their modules when first used."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable


def door(package: str, file: str) -> tuple[list[str], Callable[[str], object], Callable[[], list[str]]]:
    """The `__all__`, `__getattr__` and `__dir__` of a package that imports nothing until it is asked.

    Its public names are those that the stub beside it imports, a line each, ``from module import Name as Name``: one
    list for type checkers and for Python.

    Args:
        package: name of the package, its `__name__`.
        file: its `__file__`.

    Returns:
        The sorted public names; a function that loads one of them; a function that lists them.
    """
    module_of: dict[str, str] = {}
    with open(f"{file.rpartition('.')[0]}.pyi", encoding="utf-8") as stub:  # noqa: PTH123 - pathlib takes 4 ms to import
        for line in stub:
            if line.startswith("from "):
                _, module, _, _, _, name = line.split()
                module_of[name] = module
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
