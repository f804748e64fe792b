"""The token of a master without TLS (common/wire/token.h): where it lies, and calls that carry it."""
from __future__ import annotations

import collections
import os
import socket
import stat
from pathlib import Path
from typing import Any, Callable, Optional

import grpc

from .errors import UsageError

_FIELD = "candela-token"


def published_token_file(address: str, is_loopback: bool) -> Optional[Path]:
    """Where this user's master at `address` puts its token; None for a user without a home."""
    state = os.environ.get("XDG_STATE_HOME", "")
    if not state.startswith("/"):
        home = os.path.expanduser("~")
        if not home.startswith("/") or home == "/":
            return None
        state = os.path.join(home, ".local", "state")
    host, _, port = address.rpartition(":")
    name = socket.gethostname() if is_loopback else host.strip("[]")
    return Path(state) / "candela" / "masters" / f"{name}-{port}.token"


def read_token(file: Path) -> str:
    """Raises UsageError for a file that cannot be read or that every user of the machine can read."""
    try:
        if file.stat().st_mode & (stat.S_IROTH | stat.S_IWOTH):
            raise UsageError(f"{file}: every user of this machine can read or write the token: chmod 600 {file}")
        return file.read_text().strip()
    except OSError as error:
        raise UsageError(f"{file}: {error.strerror}") from None


_FIELDS = ("method", "timeout", "metadata", "credentials", "wait_for_ready", "compression")


class _Details(collections.namedtuple("_Details", _FIELDS), grpc.ClientCallDetails):
    """What gRPC's interceptors are given, with other metadata."""


class TokenInterceptor(grpc.UnaryUnaryClientInterceptor, grpc.UnaryStreamClientInterceptor):
    """Adds the token of a file to each call. Without the file calls go without it, and the master refuses them."""

    def __init__(self, file: Path) -> None:
        self._file = file

    def _signed(self, details: Any) -> Any:
        try:
            token = read_token(self._file)
        except UsageError:
            return details
        return _Details(
            details.method,
            details.timeout,
            [*(details.metadata or ()), (_FIELD, token)],
            details.credentials,
            getattr(details, "wait_for_ready", None),
            getattr(details, "compression", None),
        )

    def intercept_unary_unary(self, continuation: Callable[..., Any], client_call_details: Any, request: Any) -> Any:
        return continuation(self._signed(client_call_details), request)

    def intercept_unary_stream(self, continuation: Callable[..., Any], client_call_details: Any, request: Any) -> Any:
        return continuation(self._signed(client_call_details), request)
