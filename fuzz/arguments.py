"""Values of every type in every public function, class and method: a call returns, or raises an error of jacokin.

What is called is found by introspection of the public doors, so nothing new is forgotten.
"""

from __future__ import annotations

import contextlib
import enum
import gc
import importlib
import inspect
import io
import os
import signal
import tempfile
import traceback
import types
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from fuzz import examples, values
from fuzz.examples import Examples
from fuzz.findings import Finding
from jacokin.errors import JacokinError
from jacokin.viewer import Viewer

DOORS = (
    "jacokin", "jacokin.model", "jacokin.ik", "jacokin.motion", "jacokin.mujoco_bridge",
    "jacokin.mujoco_bridge.cameras", "jacokin.mujoco_bridge.distributions", "jacokin.mujoco_bridge.observations",
    "jacokin.mujoco_bridge.rewards", "jacokin.mujoco_bridge.robots", "jacokin.mujoco_bridge.workspaces",
    "jacokin.reachability", "jacokin.runner", "jacokin.tasks", "jacokin.twin", "jacokin.viewer",
)  # fmt: skip
# Made by jacokin alone, and known to compile or to run for as long as they are told to.
RESULTS = {
    "BasePlacement", "BatchResult", "BranchReport", "CrossCheckReport", "Deviation", "Expert", "IKResult", "Inspector",
    "Interval", "JointMotion", "PathResult", "ReachabilityMap", "Robot", "SolutionSet", "Source", "TargetFile",
    "TrackerStep", "Trajectory", "View", "Viewer",
}  # fmt: skip
SKIPPED = {"warmup", "Physics.disable", "ProcessLink", "run"}  # the last two start programs, or wait for an arm
# Trusted arguments, by their documentation.
INTERNAL = {
    "IKSolver.dimension_of", "Robot.once", "Robot.placement", "quat_wxyz",
    "Box.add_to", "Capsule.add_to", "Floor.add_to", "PointCloud.add_to", "PointCloud.some_points",
    "SelfContact.all_touching", "SelfContact.are_in_the_way", "SelfContact.between_rows", "SelfContact.distances",
    "SelfContact.in_the_way",
    "SelfContact.list_touching", "SelfContact.nearest", "SelfContact.nearest_between", "SelfContact.ordered",
    "SelfContact.distances_kept", "SelfContact.pair_numbers", "SelfContact.touches", "SelfContact.touches_at",
    "SelfContact.touching_from", "SelfContact.with_clearance",
    "Observables.take_over", "Orientations.free_axis", "Trajectory.of", "fall_beyond", "sin_cos",
    "PlannedMotion.begin", "PlannedMotion.step", "TwinLink.move_fingers", "TwinLink.wait",
    "Sphere.add_to", "LimitDistance.velocity", "Manipulability.velocity", "Posture.velocity",
    "Observable()", "ReachabilityMap.count_at",
    "TaskEnv.get_wrapper_attr", "TaskEnv.has_wrapper_attr", "TaskEnv.set_wrapper_attr",  # Gymnasium's own
}  # fmt: skip
TIME_LIMIT = 20.0  # [s] for one call
USES = 25  # calls between two sets of examples
GOOD = 0.65  # part of the optional arguments that are left out


class TooSlow(BaseException):
    """A call did not end in time."""


def callables(made: Examples) -> dict[str, Callable[..., object]]:
    """Every public callable by name; methods are bound to the examples."""
    found: dict[str, Callable[..., object]] = {}
    for door in DOORS:
        module = importlib.import_module(door)
        for name in _public(module):
            thing = getattr(module, name)
            if isinstance(thing, types.ModuleType) or not callable(thing):
                continue
            is_class = inspect.isclass(thing)
            if is_class and (issubclass(thing, BaseException | enum.Enum) or _has_no_instances(thing)):
                continue
            if not (is_class and name in RESULTS) and name not in SKIPPED | INTERNAL:
                # Doors may have functions of the same name.
                found[name if found.get(name, thing) is thing else f"{door.rpartition('.')[2]}.{name}"] = thing
            instance = made.instances.get(name)
            if instance is not None:
                if callable(instance) and f"{name}()" not in INTERNAL:
                    found[f"{name}()"] = instance
                for method in dir(type(instance)):
                    full = f"{name}.{method}"
                    if method.startswith("_") or full in SKIPPED | INTERNAL:
                        continue
                    if callable(getattr(type(instance), method)):  # not a property: that may raise by now
                        found[full] = getattr(instance, method)
    return dict(sorted(found.items()))


def _public(module: types.ModuleType) -> list[str]:
    """What a module says is public, or all that it defines under a public name."""
    own = [name for name, thing in vars(module).items() if getattr(thing, "__module__", None) == module.__name__]
    return list(getattr(module, "__all__", [name for name in own if not name.startswith("_")]))


def _has_no_instances(thing: type) -> bool:
    return inspect.isabstract(thing) or bool(getattr(thing, "_is_protocol", False))


def run(seed: int, first: int, cases: int) -> Iterator[tuple[int, int, list[Finding]]]:
    """Case after case, one call each."""
    signal.signal(signal.SIGALRM, _stop)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        made = examples.build(Path(folder))
        for index in range(first - first % USES, first + cases):  # earlier calls may have changed the examples
            if index % USES == 0:
                made = examples.build(Path(folder))
                gc.collect()  # simulations in circles take address space, which Python does not see
            yield index, 1, list(call(made, np.random.default_rng([seed, index])))
        os.chdir("/")


def call(made: Examples, rng: np.random.Generator) -> Iterator[Finding]:
    """One call with at least one random argument."""
    every = callables(made)
    name = list(every)[int(rng.integers(len(every)))]
    function = every[name]
    arguments = _arguments(name, function, made, rng)
    if arguments is None:
        return
    described = ", ".join(f"{key}={values.described(value)}" for key, value in arguments.items())
    signal.setitimer(signal.ITIMER_REAL, TIME_LIMIT)
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
            warnings.simplefilter("error")
            result = function(**arguments)
            if isinstance(result, Viewer):
                result.close()
    except JacokinError:
        pass
    except TooSlow:
        if name != "build":
            yield Finding("slow", name, described)
    except Exception as error:  # whatever else reaches a user is a finding
        place = traceback.extract_tb(error.__traceback__)[-1]
        if place.filename == values.__file__:
            return  # the value itself raised it
        where = f"{name}: {type(error).__name__} in {Path(place.filename).name}"
        try:
            text = f"{error}"[:200]
        except Exception:  # made of a value that cannot be shown
            text = "?"
        yield Finding("raw", where, f"{name}({described}) -> {text} at {place.filename}:{place.lineno}")
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def _arguments(
    name: str, function: Callable[..., object], made: Examples, rng: np.random.Generator
) -> dict[str, object] | None:
    """Good values for what is needed, and random ones in one or two places; None when it takes no arguments."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return None
    named = [
        parameter
        for parameter in signature.parameters.values()
        if parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY)
    ]
    if not named:
        return None
    arguments: dict[str, object] = {}
    for parameter in named:
        own = f"{name}.{parameter.name}"
        if own in made.values:
            arguments[parameter.name] = made.values[own]
        elif parameter.default is parameter.empty or rng.random() > GOOD:
            if parameter.name in made.values:
                arguments[parameter.name] = made.values[parameter.name]
            elif parameter.default is parameter.empty:
                arguments[parameter.name] = values.value(rng)
    for _ in range(1 + int(rng.integers(2))):
        chosen = named[int(rng.integers(len(named)))]
        arguments[chosen.name] = values.value(rng)
    return arguments


def _stop(*_: object) -> None:
    raise TooSlow
