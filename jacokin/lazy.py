"""Packages whose public names load their modules when first used."""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Callable
from pathlib import Path

_IMPORT = re.compile(r"^from ([\w.]+) import (?:\(([^)]*)\)|(.+))$", re.MULTILINE)


def door(package: str, file: str) -> tuple[list[str], Callable[[str], object], Callable[[], list[str]]]:
    """The `__all__`, `__getattr__` and `__dir__` of a package that imports nothing until it is asked.

    Its public names are those that the stub beside it imports, ``from module import Name as Name``: one list for type
    checkers and for Python.

    Args:
        package: name of the package, its `__name__`.
        file: its `__file__`.

    Returns:
        The sorted public names; a function that loads one of them; a function that lists them.
    """
    module_of = {}
    for module, several, single in _IMPORT.findall(Path(file).with_suffix(".pyi").read_text(encoding="utf-8")):
        for name in re.findall(r"\bas (\w+)", several or single):
            module_of[name] = module
    public = sorted(module_of)

    def load(name: str) -> object:
        module = module_of.get(name)
        if module is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}; public names: {', '.join(public)}")
        is_submodule = module == package
        value = (
            importlib.import_module(f"{module}.{name}")
            if is_submodule
            else getattr(importlib.import_module(module), name)
        )
        setattr(sys.modules[package], name, value)
        return value

    return public, load, lambda: list(public)
