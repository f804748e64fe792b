"""The connection to a master."""
from __future__ import annotations

import ipaddress
import json
import os
import time
from pathlib import Path
from typing import Any, Iterable, Iterator, Optional, Union, Unpack

import grpc

from .errors import CandelaError, UnreachableError, UsageError
from .group import Group, GroupStatus, group_status_of
from .job import Job, status_of
from .program import SceneSettings, run_program, scene_arguments
from .token import TokenInterceptor, published_token_file, read_token
from .v1 import client_pb2, client_pb2_grpc

PathLike = Union[str, "os.PathLike[str]"]

PROTOCOL = 3  # kProtocol of common/base/version.h; a test compares them
_MAX_MESSAGE_BYTES = 64 << 20
_INPUT = (grpc.StatusCode.INVALID_ARGUMENT, grpc.StatusCode.NOT_FOUND)
_AWAY = (
    grpc.StatusCode.UNAVAILABLE,
    grpc.StatusCode.RESOURCE_EXHAUSTED,
    grpc.StatusCode.DEADLINE_EXCEEDED,
)


class Farm:
    """A farm by the address of its master, HOST:PORT.

    `cert`, `key` and `ca` are PEM files, needed for a master beyond this machine unless `insecure`. `token_file` has
    the token of a master without TLS; that of a master of one's own is found without it. What is left out comes from
    $CANDELA_MASTER, $CANDELA_TLS_CERT, $CANDELA_TLS_KEY, $CANDELA_TLS_CA and $CANDELA_TOKEN_FILE. `timeout`: how many
    seconds to try to reach the master.
    """

    def __init__(
        self,
        address: Optional[str] = None,
        *,
        cert: Optional[PathLike] = None,
        key: Optional[PathLike] = None,
        ca: Optional[PathLike] = None,
        token_file: Optional[PathLike] = None,
        insecure: bool = False,
        timeout: float = 10,
    ) -> None:
        def choose(given: Optional[PathLike], variable: str) -> str:
            return os.fspath(given) if given is not None else os.environ.get(variable, "")

        self.address = choose(address, "CANDELA_MASTER")
        self.timeout = timeout
        self._insecure = insecure
        self._tls = [choose(cert, "CANDELA_TLS_CERT"), choose(key, "CANDELA_TLS_KEY"), choose(ca, "CANDELA_TLS_CA")]
        if not self.address:
            raise UsageError("no master is given: name it HOST:PORT or set $CANDELA_MASTER")
        if any(self._tls) and not all(self._tls):
            raise UsageError("cert, key and ca go together, and one is missing")
        if not any(self._tls) and not insecure and not _is_loopback(self.address):
            raise UsageError(
                f"{self.address} is not a loopback address and there is no TLS: give cert, key and ca, or "
                "insecure=True on a network you trust"
            )
        self._token_file = choose(token_file, "CANDELA_TOKEN_FILE")
        self._channel = self._dial()
        self.stub = client_pb2_grpc.FarmServiceStub(self._channel)
        self._checked = False

    def __repr__(self) -> str:
        return f"<candela.Farm {self.address}>"

    def __enter__(self) -> Farm:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._channel.close()

    def _dial(self) -> grpc.Channel:
        options = [
            ("grpc.max_receive_message_length", _MAX_MESSAGE_BYTES),
            ("grpc.initial_reconnect_backoff_ms", 100),
            ("grpc.max_reconnect_backoff_ms", 1000),
        ]
        if not any(self._tls):
            channel = grpc.insecure_channel(self.address, options=options)
            if self._token_file:
                read_token(Path(self._token_file))
                return grpc.intercept_channel(channel, TokenInterceptor(Path(self._token_file)))
            published = published_token_file(self.address, _is_loopback(self.address))
            return grpc.intercept_channel(channel, TokenInterceptor(published)) if published else channel
        cert, key, ca = (Path(name).read_bytes() for name in self._tls)
        return grpc.secure_channel(self.address, grpc.ssl_channel_credentials(ca, key, cert), options=options)

    def check(self) -> Any:
        """The master's version, build and protocol. Raises CandelaError if it speaks another protocol."""
        info = self.call("GetServerInfo", client_pb2.GetServerInfoRequest(), check=False)
        if info.protocol != PROTOCOL:
            raise CandelaError(
                f"the master at {self.address} (version {info.version}) speaks protocol {info.protocol}, this "
                f"package {PROTOCOL}: install one version on both"
            )
        self._checked = True
        return info

    def submit(
        self,
        scene: PathLike,
        *,
        name: Optional[str] = None,
        priority: int = 0,
        share: float = 1,
        token: Optional[str] = None,
        quiet: bool = True,
        **settings: Unpack[SceneSettings],
    ) -> Job:
        """Sends a scene with all its files to the farm, by `candela submit`; returns its job.

        `token`: submitting again with it returns the first job. Raises UsageError, with file and line, for a
        scene that cannot be rendered.
        """
        arguments = self._submit_arguments(scene, name, priority, share, token)
        return Job(self, json.loads(run_program(arguments + scene_arguments(settings), quiet))["id"])

    def submit_frames(
        self,
        scene: PathLike,
        frames: Union[str, Iterable[int]],
        *,
        name: Optional[str] = None,
        priority: int = 0,
        share: float = 1,
        token: Optional[str] = None,
        depends: Iterable[Union[Job, Group, str]] = (),
        quiet: bool = True,
        **settings: Unpack[SceneSettings],
    ) -> Group:
        """Sends a scene as a group of frames; returns the group.

        `frames`: numbers, or text such as "1-240x2". {frame} or {frame:4} in the scene's path, `name` and values of
        `parameters`, `settings` and `seed` is the number of the frame. `depends`: what is to be done first. `token`:
        the same call with it goes on where an earlier one broke off, or adds frames.
        """
        text = frames if isinstance(frames, str) else ",".join(str(number) for number in frames)
        arguments = self._submit_arguments(scene, name, priority, share, token) + [f"--frames={text}"]
        for other in depends:
            arguments.append(f"--depends={other if isinstance(other, str) else other.id}")
        return Group(self, json.loads(run_program(arguments + scene_arguments(settings), quiet))["id"])

    def _submit_arguments(self, scene: PathLike, name: Optional[str], priority: int, share: float,
                          token: Optional[str]) -> list[str]:
        arguments = ["submit", os.fspath(scene), "--json", *self._connection_arguments()]
        arguments += [f"--priority={priority}", f"--share={share!r}"]
        arguments += [f"--name={name}"] if name is not None else []
        return arguments + ([f"--token={token}"] if token is not None else [])

    def group(self, group_id: str) -> Group:
        return Group(self, group_id)

    def groups(self) -> list[GroupStatus]:
        """The groups of frames that the master has, the newest last, as they stand now."""
        return [group_status_of(group) for page in self.pages(fold=True) for group in page.groups][::-1]

    def job(self, job_id: str) -> Job:
        return Job(self, job_id)

    def jobs(self) -> list[Job]:
        """All jobs that the master has, the newest last."""
        return [Job(self, status.id) for page in self.pages() for status in page.jobs][::-1]

    def pages(self, **query: Any) -> Iterator[Any]:
        """The answers of ListJobs, page by page."""
        token = ""
        while True:
            answer = self.call("ListJobs", client_pb2.ListJobsRequest(page_token=token, **query))
            yield answer
            token = answer.next_page_token
            if not token:
                return

    def workers(self) -> list[Any]:
        """The workers as messages WorkerStatus of proto/candela/v1/job.proto."""
        return list(self.call("ListWorkers", client_pb2.ListWorkersRequest()).workers)

    def call(self, method: str, request: Any, *, repeat: bool = True, check: bool = True) -> Any:
        """One call of FarmService. If the master is away it is repeated for the farm's timeout."""
        if check and not self._checked:
            self.check()
        begin = time.monotonic()
        pause = 0.1
        while True:
            left = self.timeout - (time.monotonic() - begin)
            try:
                return getattr(self.stub, method)(request, timeout=max(0.1, left))
            except grpc.RpcError as error:
                if not repeat or error.code() not in _AWAY[:2] or left <= pause:
                    raise self.error_of(error) from None
            time.sleep(pause)
            pause = min(1.0, 2 * pause)

    def error_of(self, error: grpc.RpcError) -> CandelaError:
        text = error.details() or error.code().name
        if error.code() in _AWAY:
            return UnreachableError(f"cannot reach the master at {self.address}: {text}")
        return UsageError(text) if error.code() in _INPUT else CandelaError(text)

    def _connection_arguments(self) -> list[str]:
        arguments = [f"--master={self.address}", f"--timeout={self.timeout}s"]
        if any(self._tls):
            for option, value in zip(("--tls-cert", "--tls-key", "--tls-ca"), self._tls):
                arguments.append(f"{option}={value}")
        elif self._token_file:
            arguments.append(f"--token-file={self._token_file}")
        return arguments + (["--insecure"] if self._insecure else [])


def _is_loopback(address: str) -> bool:
    host = address.rpartition(":")[0].strip("[]")
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
