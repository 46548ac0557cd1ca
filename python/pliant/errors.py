"""Errors that a user can cure; each message is one line with the fact and the cure."""

from __future__ import annotations


class PliantError(Exception):
    """Base of all errors raised on purpose; a script exits with `exit_code`. errors: of advance(), the errors of all simulations
    that have failed, by number in the list."""

    exit_code = 2
    errors: dict[int, PliantError] = {}


class RunError(PliantError):
    """A run folder, a table or a request on one cannot be used."""


class OutputError(PliantError):
    """A result cannot be written."""

    exit_code = 4


class InputError(PliantError, ValueError):
    """The engine refuses an argument or an input file."""


class NumericalError(PliantError, ArithmeticError):
    """A number is not finite, an outline was crossed, or a solver failed."""

    exit_code = 3


class OutOfMemoryError(PliantError, MemoryError):
    """An allocation of the engine failed."""

    exit_code = 5


class FolderInUseError(PliantError):
    """Another process writes the folder of a run."""

    exit_code = 6


class UsageError(PliantError, RuntimeError):
    """An object is used after close, from another thread, in a fork of the process, or by a callback that may not."""


class PliantWarning(UserWarning):
    """A warning of the engine."""
