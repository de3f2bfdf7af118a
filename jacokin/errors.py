"""Everything jacokin raises on purpose.

    JacokinError
    ├── InvalidInputError (ValueError)         an argument is wrong; the message names it and its value
    │   ├── UnknownNameError                   a name that does not exist; lists the valid ones
    │   ├── RepresentationSingularity          an analytical Jacobian does not exist at this orientation
    │   └── SingularAnswerError                an answer has no gradient; gives the smallest singular value
    ├── ModelError (ValueError)                a robot description cannot be used
    │   ├── ShapeError                         the collision shapes of a description cannot be loaded
    │   └── StructureError                     the closed form does not fit this robot
    ├── SolveError                             raised by ``IKResult.raise_for_status()``
    ├── PhysicsError (RuntimeError)            the simulation is not usable or has diverged
    │   └── EpisodeInitializationError         no start of an episode was found: reject less, or try more often
    └── MissingExtraError (ImportError)        an optional package is needed; gives the install command

Not reaching a pose is a status of the result, never an exception.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

LONGEST_REPR = 200  # characters of a value in a message


def shown(value: object) -> str:
    """`value` for a message: its repr, cut where it is long."""
    try:
        text = repr(value)
    except Exception:  # a repr of the user's own, or a whole number with too many digits to print
        return f"an unprintable {type(value).__name__}"
    return text if len(text) <= LONGEST_REPR else f"{text[:LONGEST_REPR]}..."


class JacokinError(Exception):
    """Base of every error that jacokin raises on purpose; with its data it passes between processes."""

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Pickle message and attributes: the arguments of `__init__` are not those of `Exception`."""
        return _rebuild, (type(self), self.args, self.__dict__)


def _rebuild(kind: type[JacokinError], args: tuple[object, ...], attributes: dict[str, object]) -> JacokinError:
    error = kind.__new__(kind, *args)
    error.args = args
    error.__dict__.update(attributes)
    return error


class InvalidInputError(JacokinError, ValueError):
    """An argument has the wrong shape, type or value."""


class UnknownNameError(InvalidInputError):
    """A name does not exist; carries the valid ones.

    Attributes:
        kind: what was looked up, for example ``"frame"``.
        given: the name that was asked for.
        valid: the names that exist.
    """

    def __init__(self, kind: str, given: object, valid: Iterable[str]) -> None:
        """Build the message from the kind of thing, the name given and the valid names."""
        self.kind = kind
        self.given = given
        self.valid = tuple(valid)
        close = (
            difflib.get_close_matches(given, self.valid, n=1)
            if isinstance(given, str) and len(given) <= LONGEST_REPR
            else []
        )
        hint = f" Did you mean {close[0]!r}?" if close else ""
        super().__init__(f"unknown {kind} {shown(given)}.{hint} Valid: {', '.join(self.valid) or '(none)'}")


class RepresentationSingularity(InvalidInputError):  # noqa: N818 - the public name says what it is
    """The rate of an orientation representation is not a function of the joint rates here.

    Attributes:
        representation: ``"rpy"`` or ``"rotation_vector"``.
        angle: the angle at fault [rad].
    """

    def __init__(self, representation: str, name: str, angle: float) -> None:
        """Name the representation, the angle and its value [rad]."""
        self.representation = representation
        self.angle = angle
        super().__init__(
            f"the {representation} Jacobian does not exist here: {name} = {angle:.17g} rad is a singularity of "
            f"the representation. Use the geometric Jacobian or representation='quaternion'."
        )


class SingularAnswerError(InvalidInputError):
    """An answer of inverse kinematics has no gradient: its joints cannot follow every motion of the target.

    Attributes:
        singular_value: the smallest one of the Jacobian of the joints that follow [m or rad].
    """

    def __init__(self, message: str, singular_value: float) -> None:
        """Keep the singular value beside the message."""
        self.singular_value = singular_value
        super().__init__(message)


class ModelError(JacokinError, ValueError):
    """A robot description is missing, malformed, or not usable as an arm."""


class ShapeError(ModelError):
    """The collision shapes of a description cannot be loaded; kinematics does not need them, contact does."""


class StructureError(ModelError):
    """The closed form needs axes that meet or are parallel, and this robot's are not.

    Attributes:
        axes: the pair of joint names at fault.
        misfit: how far off the pair is.
        unit: unit of the misfit, ``"m"`` or ``"rad"``.
    """

    def __init__(self, message: str, axes: tuple[str, str] = ("", ""), misfit: float = 0.0, unit: str = "m") -> None:
        """Keep the pair of axes and its misfit beside the message."""
        self.axes = axes
        self.misfit = misfit
        self.unit = unit
        super().__init__(message)


class SolveError(JacokinError):
    """A pose was not reached and the caller asked for an exception; carries the result.

    Attributes:
        result: the ``IKResult`` that was not a success.
    """

    def __init__(self, message: str, result: object) -> None:
        """Keep the result beside the message."""
        self.result = result
        super().__init__(message)


class PhysicsError(JacokinError, RuntimeError):
    """The simulation is not usable: diverged, not compiled, or changed behind its back."""


class EpisodeInitializationError(PhysicsError):
    """No initial state was found in the allowed number of attempts; the simulation is as before."""


def install_command(extra: str) -> str:
    """The command that installs what an extra brings."""
    return f"pip install '.[{extra}]' (in the clone of jacokin)"


class MissingExtraError(JacokinError, ImportError):
    """An optional package is not installed; the message is the command that installs it.

    Attributes:
        package: what is missing.
        extra: of jacokin, which brings it; empty where none does.
    """

    def __init__(self, package: str, extra: str = "", *, command: str | None = None) -> None:
        """Name the package, and the extra of jacokin that brings it or else the command that does."""
        self.package = package
        self.extra = extra
        how = install_command(extra) if command is None else command
        super().__init__(f"{package} is needed for this. Install it with: {how}")


@contextmanager
def needed(package: str, extra: str = "", *, command: str | None = None) -> Iterator[None]:
    """Around the import of an optional package.

    Args:
        package: what is imported.
        extra: of jacokin, which brings it; empty where none does.
        command: what installs it otherwise, and what it needs.

    Raises:
        MissingExtraError: it, or with a command what it needs, is not installed.
    """
    try:
        yield
    except ImportError as error:
        missing = package if command is None else error.name or package
        raise MissingExtraError(missing, extra, command=command) from error
