"""Errors that a user can cure; each message is one line: what was wrong and what to do."""


class PliantError(Exception):
    """Base of all errors raised on purpose; `exit_code` is what a script returns for it."""

    exit_code = 2


class RunError(PliantError):
    """A run folder, a table or a request on one cannot be used."""


class OutputError(PliantError):
    """A result cannot be written."""

    exit_code = 4
