"""Trajectories as CSV and NPZ files that come back exactly: one way for every kind of trajectory.

A kind says which of its fields are joint values, numbers, words and notes. In a CSV file notes stand in lines before
the table, whose columns are the others.
"""

from __future__ import annotations

from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np

from jacokin.errors import InvalidInputError
from jacokin.ik.paths.storage import export, tables
from jacokin.ik.results import Frozen

FORMATS = (".csv", ".npz", ".json", ".kinova.csv")
LIMITS = ("lower", "upper", "velocity_limit")


class Layout(NamedTuple):
    """Names of the fields of a trajectory, beside `joint_names`, `t` and the limits."""

    joints: tuple[str, ...]
    """(n, dof) numbers."""
    rows: tuple[str, ...] = ()
    """(n,) numbers."""
    counts: tuple[str, ...] = ()
    """(n,) whole numbers."""
    words: tuple[str, ...] = ()
    """(n,) words."""
    numbers: tuple[str, ...] = ()
    """Arrays of any length; a file may be without them."""
    texts: tuple[str, ...] = ()
    """Single words or sentences; a file may be without them."""
    values: tuple[str, ...] = ()
    """Single numbers; a file may be without them."""

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns of a CSV file after the joints."""
        return self.rows + self.counts + self.words


if TYPE_CHECKING:

    class _Trajectory(Frozen, export.Trajectory):
        """Every kind has these, as fields or properties."""

else:
    _Trajectory = Frozen


class Stored(_Trajectory):
    """A trajectory that can be saved and loaded."""

    __slots__ = ()

    LAYOUT: ClassVar[Layout]

    def save(self, path: str | Path) -> None:
        """Write a file; an existing one is replaced only when the new one is complete.

        ".csv" and ".npz" hold everything and can be loaded. ".json" holds the fields of a ROS JointTrajectory.
        ".kinova.csv" holds angles [deg] and velocities [deg/s] at 100 Hz for Kinova's driver.

        Raises:
            InvalidInputError: another ending, the file cannot be written, or a limit is broken after resampling.
        """
        tables.save(
            path,
            {
                ".csv": self._write_csv,
                ".npz": self._write_npz,
                ".json": partial(export.write_ros_json, trajectory=self),
                ".kinova.csv": partial(export.write_kinova_csv, trajectory=self),
            },
        )

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a .csv or .npz file that `save` wrote; numbers come back exactly.

        Raises:
            InvalidInputError: no such file, or it was not written by `save`; names the line where there is one.
        """
        file, ending = tables.by_ending(path, (".csv", ".npz"))
        found = cls._read_csv(file) if ending == ".csv" else cls._read_npz(file)
        wrong = _misshapen(found, cls.LAYOUT)
        if wrong:
            raise InvalidInputError(f"{file}: {tables.NOT_OURS}: {wrong}")
        for value in found.values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
        return cls(**found)

    def _write_csv(self, file: Path) -> None:
        layout = self.LAYOUT
        numbers = np.column_stack([self.t, *(getattr(self, name) for name in (*layout.joints, *layout.rows))])
        words = [[str(word) for word in getattr(self, name)] for name in (*layout.counts, *layout.words)]
        notes = {name: tables.exact(getattr(self, name)) for name in (*LIMITS, *layout.numbers)}
        notes |= {name: [getattr(self, name)] for name in layout.texts}
        notes |= {name: [repr(getattr(self, name))] for name in layout.values}
        table = tables.Table(
            notes,
            ["t", *(f"{name}_{joint}" for name in layout.joints for joint in self.joint_names), *layout.columns],
            [[*tables.exact(row), *rest] for row, *rest in zip(numbers, *words, strict=True)],
        )
        tables.write_table(file, table)

    @classmethod
    def _read_csv(cls, file: Path) -> dict[str, Any]:
        layout, table = cls.LAYOUT, tables.read_table(file)
        dof = len(table.notes.get("lower", ()))
        names = tuple(name[len(layout.joints[0]) + 1 :] for name in table.head[1 : 1 + dof])
        head = ["t", *(f"{name}_{joint}" for name in layout.joints for joint in names), *layout.columns]
        if not dof or table.head != head:
            raise InvalidInputError(f"{file}: {tables.NOT_OURS} (head line or limits missing)")
        width = 1 + len(layout.joints) * dof + len(layout.rows)
        numbers, counts = [], []
        for row, line in enumerate(table.lines):
            try:
                numbers.append(table.numbers(row, 0, width))
                counts.append([int(cell) for cell in table.rows[row][width : width + len(layout.counts)]])
            except ValueError as error:
                raise InvalidInputError(f"{file}, line {line}: {error}") from error
        data = np.array(numbers)
        blocks = np.split(data[:, 1:], dof * np.arange(1, len(layout.joints) + 1), axis=1)
        found: dict[str, Any] = {
            "joint_names": names,
            "t": data[:, 0],
            **dict(zip(layout.joints, blocks, strict=False)),
        }
        found |= dict(zip(layout.rows, blocks[-1].T, strict=True))
        found |= dict(zip(layout.counts, np.array(counts, dtype=np.intp).T, strict=True))
        for place, name in enumerate(layout.words, start=width + len(layout.counts)):
            found[name] = tuple(row[place] for row in table.rows)
        found |= {name: np.array(table.note_numbers(file, name)) for name in LIMITS}
        noted = [name for name in (*layout.numbers, *layout.texts, *layout.values) if name in table.notes]
        for name in noted:
            if name in layout.texts:
                found[name] = "".join(table.notes[name])
            else:
                values = np.array(table.note_numbers(file, name))
                found[name] = values if name in layout.numbers else float(values[0]) if values.size else 0.0
        return found

    def _write_npz(self, file: Path) -> None:
        layout = self.LAYOUT
        kept = {"joint_names", "t", *LIMITS, *(name for names in layout for name in names)}
        tables.write_arrays(
            file,
            {field.name: np.asarray(getattr(self, field.name)) for field in fields(self) if field.name in kept},  # type: ignore[arg-type]  # every subclass is a dataclass
        )

    @classmethod
    def _read_npz(cls, file: Path) -> dict[str, Any]:
        layout = cls.LAYOUT
        arrays = tables.read_arrays(file)
        found: dict[str, Any] = {}
        try:
            for name in ("t", *LIMITS, *layout.joints, *layout.rows, *layout.counts):
                found[name] = arrays.pop(name)
            for name in ("joint_names", *layout.words):
                found[name] = tuple(str(value) for value in arrays.pop(name))
            for name in [name for name in arrays if name in layout.numbers]:
                found[name] = arrays.pop(name)
            for name in [name for name in arrays if name in layout.texts]:
                found[name] = str(arrays.pop(name))
            for name in [name for name in arrays if name in layout.values]:
                found[name] = float(arrays.pop(name))
        except (KeyError, TypeError, ValueError) as error:
            raise InvalidInputError(f"{file}: {tables.NOT_OURS}: {error}") from error
        if arrays:
            raise InvalidInputError(f"{file}: {tables.NOT_OURS}: it holds {', '.join(arrays)}")
        return found


def _misshapen(found: dict[str, Any], layout: Layout) -> str:
    """What is wrong with the fields of a file; "" if nothing is."""
    rows, dof = len(found["t"]) if np.ndim(found["t"]) == 1 else 0, len(found["joint_names"])
    shapes: dict[str, tuple[int, ...]] = {
        **dict.fromkeys(("t", *layout.rows, *layout.counts), (rows,)),
        **dict.fromkeys(layout.joints, (rows, dof)),
        **dict.fromkeys(LIMITS, (dof,)),
    }
    for name, shape in shapes.items():
        kinds = "i" if name in layout.counts else "f"
        if found[name].shape != shape or found[name].dtype.kind not in kinds:
            return f"{name} has the wrong shape or type"
    for name in layout.numbers:
        if name in found and (found[name].ndim != 1 or found[name].dtype.kind != "f"):
            return f"{name} has the wrong shape or type"
    for name in layout.words:
        if len(found[name]) != rows:
            return f"{name} has the wrong shape or type"
    if not rows:
        return "there are no rows"
    for name in ("t", *layout.joints):
        if not np.isfinite(found[name]).all():
            return f"{name} is not finite everywhere"
    return "" if (np.diff(found["t"]) > 0.0).all() else "t does not rise"
