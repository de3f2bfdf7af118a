"""Errors say what is wrong, and reach another process whole."""

from __future__ import annotations

import copy
import pickle

import pytest

from jacokin import errors
from jacokin.errors import JacokinError, UnknownNameError

ERRORS = (
    errors.JacokinError("plain"),
    errors.InvalidInputError("q must be finite"),
    errors.UnknownNameError("frame", "tool0", ["tool", "wrist"]),
    errors.RepresentationSingularity("rpy", "pitch", 1.5),
    errors.SingularAnswerError("the answer is singular", 1e-9),
    errors.ModelError("no joints"),
    errors.ShapeError("no such mesh"),
    errors.StructureError("axes apart", ("joint_3", "joint_4"), 0.02),
    errors.SolveError("UNREACHABLE: too far", None),
    errors.PhysicsError("diverged"),
    errors.EpisodeInitializationError("no state without contact in 10 attempts"),
    errors.MissingExtraError("h5py", "data"),
)


def test_no_class_is_missing_here() -> None:
    def family(kind: type[JacokinError]) -> set[type[JacokinError]]:
        return {kind}.union(*(family(child) for child in kind.__subclasses__()))

    assert {type(error) for error in ERRORS} == {
        kind for kind in family(JacokinError) if kind.__module__ == errors.__name__
    }


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_errors_pass_between_processes(error: JacokinError) -> None:
    for other in (pickle.loads(pickle.dumps(error)), copy.deepcopy(error)):
        assert type(other) is type(error)
        assert str(other) == str(error)
        assert vars(other) == vars(error)


def test_names_of_any_type_are_shown() -> None:
    assert "Did you mean 'tool'?" in str(UnknownNameError("frame", "tool0", ["tool"]))
    assert "an unprintable int" in str(UnknownNameError("frame", 10**5000, ["tool"]))
    assert len(str(UnknownNameError("frame", "x" * 10**6, ["tool"]))) < 300
