"""`Recorded`, an episode as it is kept, and the checks of what was read from disk, which anybody may have changed.

`placing` is where a data set is written until it is complete, so that a kill or a full disk leaves no part of it.
"""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jacokin import documents
from jacokin.arrays import Array
from jacokin.chunks.folder import temporary
from jacokin.errors import InvalidInputError, shown
from jacokin.files import parsing, read_arrays, reason
from jacokin.model import checks

SINGLE = "observation"  # name of an observation that has none
NOT_OURS, NOT_AN_EPISODE = "is not a data set that jacokin wrote, or damaged", "is not an episode, or damaged"
#: What `describe` gave, as far as that can be said without making the environment.
DESCRIPTION_FORM = {"id": str, "kwargs": {"reward": object}}
_ARRAYS = ("actions", "rewards", "success", "states")
_OBSERVED = "observed "  # begins the names of observations among those of arrays


@dataclass(frozen=True, slots=True, eq=False)
class Recorded:
    """An episode of n control steps.

    Attributes:
        seed: from which it was reset.
        observations: (n + 1, ...) by name: before each action, and after the last.
        actions: (n, k) in the units of the control.
        rewards: (n,).
        success: (n,) bool, after each step.
        states: (n + 1, m) of the simulation, as `Physics.set_state` takes them.
        randomization: values of the episode by name.
        error: why the simulation diverged; "" if it did not.
    """

    seed: int
    observations: Mapping[str, NDArray[Any]]
    actions: Array
    rewards: Array
    success: NDArray[np.bool_]
    states: Array
    randomization: Mapping[str, float]
    error: str = ""

    def to_bytes(self) -> bytes:
        """The episode as the bytes of an .npz file."""
        arrays: dict[str, Any] = {name: getattr(self, name) for name in _ARRAYS}
        arrays.update({_OBSERVED + name: values for name, values in self.observations.items()})
        arrays.update(seed=self.seed, error=self.error)
        arrays["varied"] = np.array(list(self.randomization), dtype=str)
        arrays["values"] = np.array(list(self.randomization.values()), dtype=np.float64)
        file = io.BytesIO()
        np.savez(file, **arrays)
        return file.getvalue()

    @classmethod
    def from_file(cls, path: Path) -> Recorded:
        """Of what `to_bytes` gave.

        Raises:
            InvalidInputError: the file is damaged.
        """
        names = (*_ARRAYS, "seed", "error", "varied", "values")
        arrays: dict[str, Any] = dict(read_arrays(path, NOT_AN_EPISODE, names))
        observations = {
            name.removeprefix(_OBSERVED): each for name, each in arrays.items() if name.startswith(_OBSERVED)
        }
        with parsing(path, NOT_AN_EPISODE):
            varied = dict(zip(arrays["varied"].tolist(), arrays["values"].tolist(), strict=True))
            plain = {name: arrays[name] for name in _ARRAYS}
            seed, error = arrays["seed"].item(), arrays["error"].item()
            found = cls(seed, observations, **plain, randomization=varied, error=error)
        return found.checked(str(path))

    def checked(self, place: str) -> Recorded:
        """This episode, if it is one: arrays of the right kinds, as many rows of each as there were steps.

        Args:
            place: what an error calls the episode.

        Raises:
            InvalidInputError: it is none; names what is wrong with which part.
        """
        if not isinstance(self.seed, int) or isinstance(self.seed, bool) or self.seed < 0:
            raise _refusal(place, "seed", "a whole number >= 0", self.seed)
        if not isinstance(self.error, str):
            raise _refusal(place, "error", "a text", self.error)
        self._check_steps(place)
        rows = len(self.actions) + 1
        for name, values in self.observations.items():
            is_array = isinstance(values, np.ndarray) and values.dtype.kind in "biuf"
            if not is_array or values.shape[:1] != (rows,):
                raise _refusal(place, f"observation {name!r}", f"numbers of shape ({rows}, ...)", values)
        for name, value in self.randomization.items():
            if not isinstance(name, str) or not isinstance(value, float) or not np.isfinite(value):
                raise _refusal(place, f"randomization {shown(name)}", "a finite number", value)
        return self

    def _check_steps(self, place: str) -> None:
        """Refuse actions, rewards, successes or states that do not belong together.

        Raises:
            InvalidInputError: they do not.
        """
        if not isinstance(self.actions, np.ndarray) or self.actions.ndim != 2 or 0 in self.actions.shape:
            raise _refusal(place, "actions", "float64 of shape (n, k)", self.actions)
        steps = len(self.actions)
        for name, shape in (("actions", self.actions.shape), ("rewards", (steps,)), ("success", (steps,))):
            values, kind = getattr(self, name), np.dtype(bool if name == "success" else np.float64)
            if not isinstance(values, np.ndarray) or values.dtype != kind or values.shape != shape:
                raise _refusal(place, name, f"{kind} of shape {shape}", values)
            if not np.isfinite(values).all():
                raise InvalidInputError(f"{place} is damaged: {name} must be finite")
        states = self.states
        if not isinstance(states, np.ndarray) or states.dtype != np.float64 or states.shape[:1] != (steps + 1,):
            raise _refusal(place, "states", f"float64 of shape ({steps + 1}, m)", states)

    def differences(self, other: Recorded) -> list[str]:
        """The names of what is not the same bit by bit in another episode; observations only if this one has some."""
        found = [name for name in _ARRAYS if not _same(getattr(self, name), getattr(other, name))]
        seen = sorted({*self.observations, *other.observations} if self.observations else ())
        found += [name for name in seen if not _same(self.observations.get(name), other.observations.get(name))]
        if dict(self.randomization) != dict(other.randomization):
            found.append("randomization")
        return found + (["error"] if self.error != other.error else [])


def _refusal(place: str, name: str, what: str, value: object) -> InvalidInputError:
    """The error that a part of an episode must be something else."""
    got = f"{value.dtype} of shape {value.shape}" if isinstance(value, np.ndarray) else shown(value)
    return InvalidInputError(f"{place} is damaged: {name} must be {what}, got {got}")


def _same(one: NDArray[Any] | None, other: NDArray[Any] | None) -> bool:
    if one is None or other is None or one.dtype != other.dtype or one.shape != other.shape:
        return False
    return one.tobytes() == other.tobytes()  # NaN too, of a simulation that diverged


def read_json(path: Path, form: object) -> dict[str, Any]:
    """The object of a form in a JSON file of a data set.

    Raises:
        InvalidInputError: something else than a file of sensible size that holds it, or a link.
    """
    if path.is_symlink() or not path.is_file():
        raise InvalidInputError(f"{path}: there is no such file")
    found: dict[str, Any] = documents.read_json(path, NOT_OURS, form, 100_000_000)  # [byte]
    return found


def count(name: str, value: object, expected: int) -> None:
    """Check a number that a data set tells of itself.

    Raises:
        ValueError: another one.
    """
    if checks.whole_number(name, value) != expected:
        raise ValueError(f"{name} says {shown(value)}, and there are {expected}")


def episodes_folder(path: Path) -> Path:
    """The folder of a recording that is not complete: finished episodes, and what a kill has left."""
    return path.with_name(f"{path.name}.episodes")


def check_free(path: Path) -> None:
    """Check that nothing is at a path yet.

    Raises:
        InvalidInputError: something is, or nothing can be called so.
    """
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        return  # whoever writes finds out whether it can be
    except (OSError, ValueError) as error:
        raise InvalidInputError(f"{path}: cannot be written: {reason(error)}") from error
    left = f"; {episodes_folder(path)} is left of its recording" if episodes_folder(path).exists() else ""
    raise InvalidInputError(f"path: {path} is there already; data sets are never changed{left}")


@contextlib.contextmanager
def placing(path: Path) -> Iterator[Path]:
    """A temporary path in the folder of the recording, for a file or a folder; in the end it is moved to its place.

    Raises:
        InvalidInputError: something is there already, or the disk is full or fails.
    """
    folder = episodes_folder(path)
    try:
        folder.mkdir(exist_ok=True)
        with temporary(folder) as unfinished:
            yield unfinished
            check_free(path)
            unfinished.replace(path)
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        kept = f"; {folder} keeps its episodes: when that is mended, record it again to continue"
        raise InvalidInputError(
            f"{path}: cannot be written: {reason}{kept if folder.is_dir() and any(folder.iterdir()) else ''}"
        ) from error
    finally:
        with contextlib.suppress(OSError):
            folder.rmdir()  # if it is empty: whoever keeps episodes in it removes them
