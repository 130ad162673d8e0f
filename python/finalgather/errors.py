"""Errors and warnings. Each error says its problem and a cure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Union

if TYPE_CHECKING:
    from ._finalgather import Baked, Film


class Error(Exception):
    """Base of all errors."""

    def __init__(self, problem: str, cure: str) -> None:
        # Both are arguments, so that an error survives its way between processes.
        super().__init__(problem, cure)
        self.problem = problem
        self.cure = cure

    def __str__(self) -> str:
        return f"{self.problem}\n  cure: {self.cure}"


class InputError(Error, ValueError):
    """A file or an array cannot be used."""


class UsageError(Error, ValueError):
    """The request is impossible."""


class DeviceError(Error, RuntimeError):
    """There is no OpenGL 3.3, or it failed."""


class OutputError(Error, OSError):
    """A file could not be written."""

    def __init__(self, problem: str, cure: str) -> None:
        super().__init__(problem, cure)
        # OSError takes the two for a number and its meaning.
        self.errno = None
        self.strerror = problem


class Warning(UserWarning):
    """Something was mended, or may not be what was meant."""


class Interrupted(KeyboardInterrupt):
    """Ctrl-C ended a job. `result` is what was done up to there, or None."""

    def __init__(self, result: Union[Film, Baked, None] = None) -> None:
        super().__init__("ended by Ctrl-C" if result is None else "ended by Ctrl-C; .result holds what was done")
        self.result = result

    def __reduce__(self) -> tuple[type[Interrupted], tuple[()]]:
        # A result does not travel between processes.
        return type(self), ()
