"""Errors, by what the caller can do about them (the exit codes of the command `candela`)."""
from __future__ import annotations


class CandelaError(Exception):
    """The farm refused, or something failed: exit code 1."""

    exit_code = 1


class UsageError(CandelaError, ValueError):
    """Bad usage or input, such as a scene that cannot be read: a retry will not help."""

    exit_code = 2


class UnreachableError(CandelaError, ConnectionError):
    """The master cannot be reached, or is overloaded: try again."""

    exit_code = 3


class JobError(CandelaError):
    """A job failed or was cancelled. `status` is its last status."""

    def __init__(self, message: str, status: object = None) -> None:
        super().__init__(message)
        self.status = status


def error_of_code(exit_code: int, message: str) -> CandelaError:
    for kind in (UsageError, UnreachableError):
        if kind.exit_code == exit_code:
            return kind(message)
    return CandelaError(message)
