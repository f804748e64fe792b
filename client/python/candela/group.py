"""A group of frames: how it stands, its images, and steering all its frames."""
from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Iterator, Optional

from .image import Image
from .job import Ending, Job, finite, state_name, wait_for
from .v1 import client_pb2

if TYPE_CHECKING:
    from .farm import Farm


@dataclass(frozen=True)
class GroupStatus(Ending):
    """How a group stands. `message` is the whole answer of the master (proto/candela/v1/job.proto)."""

    id: str
    name: str
    state: str  # queued, running, paused, done, failed or cancelled
    text: str  # of the first frame that failed, or what is worth knowing now
    frames: int
    states: dict[str, int]  # frames by state; states without any are left out
    fraction_done: float
    eta_seconds: Optional[float]
    priority: int
    message: Any = field(repr=False)


def group_status_of(message: Any) -> GroupStatus:
    return GroupStatus(
        id=message.id,
        name=message.name,
        state=state_name(message.state),
        text=message.message,
        frames=message.frames,
        states={state_name(count.state): count.jobs for count in message.states},
        fraction_done=message.fraction_done,
        eta_seconds=finite(message.eta_seconds),
        priority=message.priority,
        message=message,
    )


class Group:
    """A group by its id. Made by Farm.submit_frames() and Farm.group(); asks the master at each call."""

    def __init__(self, farm: Farm, group_id: str) -> None:
        self._farm = farm
        self.id = group_id

    def __repr__(self) -> str:
        return f"<candela.Group {self.id} at {self._farm.address}>"

    def status(self) -> GroupStatus:
        return group_status_of(self._farm.call("GetGroup", client_pb2.GetGroupRequest(group_id=self.id)))

    def frames(self) -> dict[int, Job]:
        """The frames' jobs by the numbers of their frames, in order."""
        jobs: dict[int, Job] = {}
        for page in self._farm.pages(group_id=self.id):
            jobs.update((status.frame.frame, Job(self._farm, status.id)) for status in page.jobs)
        return dict(sorted(jobs.items()))

    def watch(self, interval: float = 1.0) -> Iterator[GroupStatus]:
        """A status now, at each change (looked for every `interval` seconds), and a last one at the group's end."""
        last = None
        while True:
            status = self.status()
            if last is None or status.message != last.message:
                yield status
            if status.ended:
                return
            last = status
            time.sleep(interval)

    def wait(self) -> GroupStatus:
        """The last status, once all frames are done. Raises JobError if some failed or were cancelled."""
        return wait_for("group", self)

    def images(self, **options: Any) -> Iterator[tuple[int, Image]]:
        """The number and the image of each frame that has one, one after the other. `options`: those of Job.image()."""
        for number, job in self.frames().items():
            if job.status().message.units_merged > 0:
                yield number, job.image(**options)

    def pause(self) -> GroupStatus:
        return self._steer("ACTION_PAUSE")

    def resume(self) -> GroupStatus:
        """Lets paused and failed frames go on."""
        return self._steer("ACTION_RESUME")

    def cancel(self) -> GroupStatus:
        """Ends all frames that have not ended; their images are kept."""
        return self._steer("ACTION_CANCEL")

    def set_priority(self, priority: int) -> GroupStatus:
        return self._steer("ACTION_PRIORITY", priority)

    def _steer(self, action: str, priority: int = 0) -> GroupStatus:
        value = client_pb2.SteerGroupRequest.Action.Value(action)
        request = client_pb2.SteerGroupRequest(group_id=self.id, action=value, priority=priority)
        return group_status_of(self._farm.call("SteerGroup", request))
