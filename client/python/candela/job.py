"""One job of a farm: how it stands, its image, and steering it."""
from __future__ import annotations

import hashlib
import math
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Iterator, Optional

import grpc

from .errors import CandelaError, JobError
from .image import Image, decode_image
from .v1 import client_pb2, job_pb2

if TYPE_CHECKING:
    from .farm import Farm

_STALL_SECONDS = 600  # the master develops the film before it sends
_AWAY = (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.CANCELLED, grpc.StatusCode.DEADLINE_EXCEEDED)


class Ending:
    """A status of what has an end."""

    state: str

    @property
    def ended(self) -> bool:
        return self.state in ("done", "failed", "cancelled")


@dataclass(frozen=True)
class Status(Ending):
    """How a job stands. `message` is the whole answer of the master (proto/candela/v1/job.proto)."""

    id: str
    name: str
    state: str  # queued, running, paused, done, failed or cancelled
    text: str  # why it failed, or what is worth knowing now
    iterations: int  # merged
    samples: int
    relmse: Optional[float]  # estimated; None until both halves of the job have iterations
    relmse_upper: Optional[float]  # upper end of its 95 % interval, which ends a job that has such a limit
    elapsed_seconds: float
    eta_seconds: Optional[float]
    samples_per_second: float
    submitter: str  # user@host, or the name of a certificate
    message: Any = field(repr=False)

    @property
    def unseen_light(self) -> list[str]:
        """Notes of the plan on light that the error may leave out, with an integrator that finds it."""
        lines = self.message.plan.splitlines()
        return [line.removeprefix("note ") for line in lines if line.startswith("note light ")]


def state_name(value: int) -> str:
    return job_pb2.JobState.Name(value).removeprefix("JOB_STATE_").lower()


def finite(value: float) -> Optional[float]:
    return value if math.isfinite(value) else None


def wait_for(what: str, thing: Any) -> Any:
    """The last status of a job or group, once it is done. Raises JobError if it failed or was cancelled."""
    status = thing.status()
    for status in thing.watch():
        pass
    if status.state != "done":
        text = f"{what} {thing.id} is {status.state}" + (f": {status.text}" if status.text else "")
        raise JobError(text, status)
    return status


def status_of(message: Any) -> Status:
    return Status(
        id=message.id,
        name=message.name,
        state=state_name(message.state),
        text=message.message,
        iterations=message.iterations,
        samples=message.samples,
        relmse=finite(message.relmse_estimate) if message.iterations else None,
        relmse_upper=finite(message.relmse_upper) if message.relmse_upper > 0 else None,
        elapsed_seconds=message.elapsed_seconds,
        eta_seconds=finite(message.eta_seconds),
        samples_per_second=message.samples_per_second,
        submitter=message.submitter,
        message=message,
    )


class Job:
    """A job by its id. Made by Farm.submit(), Farm.job() and Farm.jobs(); asks the master at each call."""

    def __init__(self, farm: Farm, job_id: str) -> None:
        self._farm = farm
        self.id = job_id

    def __repr__(self) -> str:
        return f"<candela.Job {self.id} at {self._farm.address}>"

    def status(self) -> Status:
        return status_of(self._farm.call("GetJob", client_pb2.GetJobRequest(job_id=self.id)))

    def watch(self, interval: float = 1.0) -> Iterator[Status]:
        """A status now, at each change (at most every `interval` seconds), and a last one at the job's end.

        A master that is away for no longer than the farm's timeout is waited for.
        """
        request = client_pb2.WatchJobRequest(job_id=self.id, interval_ms=max(1, round(1000 * interval)))
        answered = time.monotonic()
        while True:
            # A stream for a bounded time, then a new one, so that a connection that went dead is noticed.
            stream = self._farm.stub.WatchJob(request, timeout=max(20.0, self._farm.timeout))
            alive = False
            try:
                for message in stream:
                    alive = True
                    status = status_of(message)
                    yield status
                    answered = time.monotonic()
                    if status.ended:
                        return
            except grpc.RpcError as error:
                if error.code() not in _AWAY:
                    raise self._farm.error_of(error) from None
                if not alive and time.monotonic() - answered > self._farm.timeout:
                    raise self._farm.error_of(error) from None
            finally:
                stream.cancel()  # also if the caller leaves the loop
            time.sleep(0.2)

    def wait(self) -> Status:
        """The last status of the job, once it is done. Raises JobError if it failed or was cancelled."""
        return wait_for("job", self)

    def image(
        self,
        *,
        layers: bool = True,
        error_layer: bool = False,
        variance_layer: bool = False,
        chain_layers: bool = False,
        state_layers: bool = False,
        estimator: str = "",
        half: Optional[str] = None,
        partial: bool = False,
    ) -> Image:
        """The image of what is merged now; see `candela fetch --help`. `half`: "A" or "B"."""
        halves = {None: "HALF_UNSPECIFIED", "A": "HALF_A", "B": "HALF_B"}
        if half not in halves:
            raise ValueError(f"half is 'A', 'B' or None, not {half!r}")
        request = client_pb2.FetchImageRequest(
            job_id=self.id,
            error_layer=error_layer,
            variance_layer=variance_layer,
            image_only=not layers,
            chain_layers=chain_layers,
            state_layers=state_layers,
            estimator=estimator,
            half=client_pb2.FetchImageRequest.Half.Value(halves[half]),
            partial=partial,
        )
        return decode_image(self._fetch(request))

    def _fetch(self, request: Any) -> bytes:
        """The bytes of the file. After a lost connection it goes on from the byte that it has."""
        data, sha256, total = bytearray(), "", 0
        lost: Optional[float] = None  # since when there is no connection
        while True:
            request.sha256, request.offset = sha256, len(data)
            try:
                first = True
                for chunk in self._farm.stub.FetchImage(request, timeout=_STALL_SECONDS):
                    if first and (chunk.sha256 != sha256 or chunk.offset != len(data)):
                        data.clear()  # the master has another image by now, and sends that one
                        sha256 = chunk.sha256
                    if first:
                        total = chunk.total_bytes
                    first, lost = False, None
                    data += chunk.data
                break
            except grpc.RpcError as error:
                lost = lost or time.monotonic()
                retry = error.code() in (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.RESOURCE_EXHAUSTED)
                if not retry or time.monotonic() - lost > self._farm.timeout:
                    raise self._farm.error_of(error) from None
                time.sleep(0.2)
        if len(data) != total or hashlib.sha256(data).hexdigest() != sha256:
            raise CandelaError(f"the master at {self._farm.address} sent other bytes of an image than it said")
        return bytes(data)

    def pause(self) -> Status:
        return self._steer("PauseJob")

    def resume(self) -> Status:
        """Lets a paused or failed job go on."""
        return self._steer("ResumeJob")

    def cancel(self) -> Status:
        """Ends the job; its image is kept."""
        return self._steer("CancelJob")

    def set_priority(self, priority: int) -> Status:
        """Jobs of higher priority go first; units of lower ones are cut short."""
        request = client_pb2.SetPriorityRequest(job_id=self.id, priority=priority)
        return status_of(self._farm.call("SetPriority", request))

    def extend(self, *, iterations: int = 0, seconds: float = 0, relmse: float = 0) -> Status:
        """Adds to the job's limits; `relmse` is a new target. A finished job goes on.

        It is asked for once: after UnreachableError, look whether the job is extended.
        """
        if not (iterations or seconds or relmse):
            raise ValueError("there is nothing to extend by: give iterations, seconds or relmse")
        self._farm.check()
        request = client_pb2.ExtendJobRequest(
            job_id=self.id, add_iterations=iterations, add_time_seconds=seconds, relmse=relmse
        )
        return status_of(self._farm.call("ExtendJob", request, repeat=False))

    def _steer(self, method: str) -> Status:
        return status_of(self._farm.call(method, client_pb2.JobRequest(job_id=self.id)))
