# SPDX-License-Identifier: BSD-3-Clause
"""Live messages on their way to Rerun, which is never waited for where they arrive."""

import threading
import time
from collections import deque
from typing import NamedTuple

from grid_map_ros_py.errors import DROPPED, reason

from .scene import Scene, Style
from .server import Server

QUEUES = {
    "tf2_msgs/msg/TFMessage": 1000,
    "diagnostic_msgs/msg/DiagnosticArray": 100,
    "visualization_msgs/msg/Marker": 100,
    "visualization_msgs/msg/MarkerArray": 100,
}
"""Number of messages of a topic that wait, by type, if a message does not replace the one before.

Transforms and diagnostics come from many nodes, and markers add to each other.
"""

PATIENCE = 0.2
"""Time between two looks whether the end has come, while Rerun takes no data [s]."""

STALL = 2.0
"""Time without progress after which it is a problem that Rerun takes no data [s]."""


class Arrival(NamedTuple):
    """A message in CDR with its type, and the time [ns] at which it arrived."""

    topic: str
    kind: str
    data: bytes
    time: int


class Feeder:
    """Writes messages to Rerun in a thread of its own; of most topics, only the newest one waits.

    Args:
        server: where the recording is served.
        style: how maps are drawn.
        max_rate: largest rate of a topic whose messages replace each other [Hz].

    Attributes:
        shown: number of messages that were written.
        replaced: number of messages that went for newer ones.
        problem: why nothing is shown at the moment; empty if there is no reason.
    """

    def __init__(self, server: Server, style: Style, max_rate: float) -> None:
        self.shown = self.replaced = 0
        self.problem = ""
        self._server, self._recording = server, server.recording
        self._scene, self._period = Scene(server.recording, style), 1 / max_rate
        self._refusals: deque[str] = deque(maxlen=100)
        self._waiting: dict[str, deque[Arrival]] = {}
        self._due: dict[str, float] = {}
        self._change = threading.Condition()
        self._is_closed = False
        # A daemon: a program that hangs must not keep the node from ending.
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def put(self, topic: str, kind: str, data: bytes) -> None:
        """Let the thread take a message; this never waits for Rerun."""
        arrival = Arrival(topic, kind, data, time.time_ns())
        with self._change:
            queue = self._waiting.setdefault(topic, deque(maxlen=QUEUES.get(kind, 1)))
            self.replaced += len(queue) == queue.maxlen
            queue.append(arrival)
            self._change.notify()

    def take_refusals(self) -> list[str]:
        """Return why messages could not be shown since the last call."""
        return [self._refusals.popleft() for _ in range(len(self._refusals))]

    def close(self) -> None:
        """Take no further messages."""
        with self._change:
            self._is_closed = True
            self._change.notify()
        self._thread.join(2 * PATIENCE)

    def _run(self) -> None:
        while not self._is_closed:
            for arrival in self._next():
                self._write(arrival)
            self._deliver()

    def _next(self) -> list[Arrival]:
        """Wait until messages are due; return the due ones of all topics, none at the end."""
        with self._change:
            while not self._is_closed:
                now, found = time.monotonic(), list[Arrival]()
                soon = None
                for topic, queue in self._waiting.items():
                    due = self._due.get(topic, now)
                    if queue and due > now:
                        soon = min(due, soon or due)
                    elif queue:
                        found += queue
                        if queue.maxlen == 1:
                            self._due[topic] = now + self._period
                        queue.clear()
                if found:
                    return found
                self._change.wait(soon and soon - now)
        return []

    def _write(self, arrival: Arrival) -> None:
        topic, kind, data, log_time = arrival
        try:
            self._scene.log_message(topic, kind, data, log_time=log_time)
        except Exception as error:  # Messages may hold anything, and Rerun has no tree of errors.
            why = reason(error) if isinstance(error, DROPPED) else repr(error)
            self._refusals.append(f"{topic}: {why}")
        else:
            self.shown += 1

    def _deliver(self) -> None:
        """Wait until Rerun has all, so that little memory is on the way."""
        if self._scene.changed:
            self._recording.send_blueprint(self._scene.layout())
        begin = time.monotonic()
        while not self._is_closed:
            try:
                self._recording.flush(timeout_sec=PATIENCE)
            except Exception:  # Also at the end of the program, which the server tells.
                waited = time.monotonic() - begin
                if waited > STALL:
                    self.problem = f"Rerun has taken no data for {waited:.0f} s"
                # It returns at once if the connection has ended.
                time.sleep(PATIENCE / 10)
            else:
                self.problem = ""
                return
