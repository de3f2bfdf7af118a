"""Packages whose public names load their modules when first used."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping, Sequence


def door(
    package: str, modules: Mapping[str, Sequence[str]], submodules: Sequence[str] = ()
) -> tuple[list[str], Callable[[str], object], Callable[[], list[str]]]:
    """The `__all__`, `__getattr__` and `__dir__` of a package that imports nothing until it is asked.

    Args:
        package: name of the package, its `__name__`.
        modules: full module names, each with the public names that live in it.
        submodules: public modules of the package itself.

    Returns:
        The sorted public names; a function that loads one of them; a function that lists them.
    """
    module_of = {name: module for module, names in modules.items() for name in names}
    public = sorted([*module_of, *submodules])

    def load(name: str) -> object:
        if name in module_of:
            value: object = getattr(importlib.import_module(module_of[name]), name)
        elif name in submodules:
            value = importlib.import_module(f"{package}.{name}")
        else:
            raise AttributeError(f"module {package!r} has no attribute {name!r}; public names: {', '.join(public)}")
        setattr(sys.modules[package], name, value)
        return value

    return public, load, lambda: list(public)
