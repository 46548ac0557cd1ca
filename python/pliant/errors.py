"""Errors that a user can cure; each message is one line with the fact and the cure."""


class PliantError(Exception):
    """Base of all errors raised on purpose; a script exits with `exit_code`."""

    exit_code = 2


class RunError(PliantError):
    """A run folder, a table or a request on one cannot be used."""


class OutputError(PliantError):
    """A result cannot be written."""

    exit_code = 4
