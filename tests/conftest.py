"""Shared fixtures: loaded robots are immutable, so one of each serves every test."""

from __future__ import annotations

import functools
import gc
import signal
import sys
from collections.abc import Callable, Generator, Iterator
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from hypothesis import HealthCheck, settings

import jacokin
from jacokin import Robot
from jacokin.kernels import library
from jacokin.tasks import registry
from tests.robot_files import INCLUDED, SCENE

# Tests compare with other code in the folders beside the package. Last: the installed package is what gets tested.
sys.path.append(str(Path(__file__).resolve().parents[1]))

# The same examples every time, however slow the machine is at the moment.
settings.register_profile("jacokin", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("jacokin")

# A shell's background commands ignore SIGINT, and nohup SIGHUP; so would the processes that tests start and interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_sessionstart() -> None:
    """Kernels that were changed and not compiled would pass tests that they should not."""
    if library.Library(library.PATH).about.sources != library.sources_key():
        raise pytest.UsageError(f"{library.PATH} was built from other sources: run `python -m build_kernels`")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """What is collected lives until the end: looking for dead objects among it takes a twentieth of all time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


_QUICK = set[tuple[object, ...]]()


def pytest_itemcollected(item: pytest.Item) -> None:
    """Mark cases as slow that follow the first one of a test that is marked with `one_quick`."""
    mark = item.get_closest_marker("one_quick")
    if mark is None or item.get_closest_marker("slow"):
        return
    assert isinstance(item, pytest.Function)  # what has cases
    parameters = item.callspec.params
    assert parameters.keys() >= set(mark.args), f"{item.nodeid} has no {mark.args}"
    others = (id(value) for name, value in parameters.items() if mark.args and name not in mark.args)
    case = (item.parent, item.originalname, *others)
    if case in _QUICK:
        item.add_marker("slow")
    _QUICK.add(case)


@functools.cache
def _robot(name: str) -> Robot:
    return jacokin.load_robot(name)


@pytest.fixture(scope="session")
def robot() -> Robot:
    return _robot("j2n6s300")


@pytest.fixture(scope="session")
def bundled() -> Callable[[str], Robot]:
    return _robot


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20260101)


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    (tmp_path / "common.xml").write_text(INCLUDED)
    path = tmp_path / "scene.xml"
    path.write_text(SCENE)
    return path


@pytest.fixture
def own_tasks() -> Iterator[None]:
    """Tasks that are registered in a test are forgotten after it: other tests look at all there are."""
    before = set(registry.TASKS)
    yield
    for name in set(registry.TASKS) - before:
        del registry.TASKS[name]
        gymnasium.registry.pop(name, None)
