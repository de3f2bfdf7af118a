"""Packages whose public names load their modules when first used (PEP 562)."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping


def door(
    package: str, names_of: Mapping[str, tuple[str, ...]]
) -> tuple[list[str], Callable[[str], object], Callable[[], list[str]]]:
    """The `__all__`, `__getattr__` and `__dir__` of a package that imports nothing until it is asked.

    The stub beside the package imports the same names, for type checkers.

    Args:
        package: name of the package, its `__name__`.
        names_of: module, and the public names that come from it; the package itself, and modules of it.

    Returns:
        The sorted public names; a function that loads one of them; a function that lists them.
    """
    module_of = {name: module for module, names in names_of.items() for name in names}
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
