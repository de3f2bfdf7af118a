"""Packages whose public names load their modules when first used (PEP 562)."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable


def door(package: str) -> tuple[list[str], Callable[[str], object], Callable[[], list[str]]]:
    """The `__all__`, `__getattr__` and `__dir__` of a package that imports nothing until it is asked.

    What is public, and where it comes from, stands in the stub beside the package, where type checkers read it, too:
    `from jacokin.model.scene import Scene as Scene`, one name a line.

    Args:
        package: name of the package, its `__name__`.

    Returns:
        The sorted public names; a function that loads one of them; a function that lists them.
    """
    stub = f"{sys.modules[package].__path__[0]}/__init__.pyi"
    with open(stub, encoding="utf-8") as lines:  # noqa: PTH123 - pathlib takes longer to load than all of this
        imports = [line.split() for line in lines if line.startswith("from ")]
    module_of = {words[-1]: words[1] for words in imports}
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
