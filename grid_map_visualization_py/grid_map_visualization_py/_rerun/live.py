# SPDX-License-Identifier: BSD-3-Clause
"""Queues live messages and writes them to Rerun."""

import time
from collections import deque
from typing import Any

from grid_map_ros_py.errors import DROPPED, reason

from .scene import Scene, Style

QUEUES = {
    "tf2_msgs/msg/TFMessage": 1000,
    "diagnostic_msgs/msg/DiagnosticArray": 100,
    "visualization_msgs/msg/Marker": 100,
    "visualization_msgs/msg/MarkerArray": 100,
}
"""Queue length per topic, by message type; for other types, only the newest message is kept.

Transforms and diagnostics come from many nodes, and a marker usually adds to earlier markers, so a
new message must not simply replace the previous one.
"""

FLUSH_TIME = 0.2
"""Maximum time that `LiveScene` waits for Rerun in each flush [s]."""

STALL = 30.0
"""Time after which `LiveScene.problem` reports that Rerun accepts no data [s].

Slow browsers block Rerun for several seconds while they load the page.
"""


class LiveScene:
    """Queues the newest messages of each topic until they are written to Rerun.

    `replaced` counts messages that newer messages replaced before they were written.
    """

    def __init__(self, recording: Any, style: Style) -> None:
        self.shown = self.replaced = 0
        self.problem = ""
        self._recording, self._scene = recording, Scene(recording, style)
        # Type, CDR data and arrival time [ns] of the queued messages, by topic.
        self._waiting: dict[str, deque[tuple[str, bytes, int]]] = {}
        self._stalled_since: float | None = None

    def put(self, topic: str, kind: str, data: bytes) -> None:
        """Queue a CDR message of type `kind` until the next `write`."""
        queue = self._waiting.setdefault(topic, deque(maxlen=QUEUES.get(kind, 1)))
        self.replaced += len(queue) == queue.maxlen
        queue.append((kind, data, time.time_ns()))

    def write(self) -> list[str]:
        """Write the queued messages unless Rerun is busy; return the errors of invalid messages."""
        if self._stalled_since is not None and not self._delivers():
            return []
        refusals = []
        for topic, queue in self._waiting.items():
            while queue:
                kind, data, log_time = queue.popleft()
                try:
                    self._scene.log_message(topic, kind, data, log_time=log_time)
                    self.shown += 1
                except Exception as error:  # Malformed messages may cause any exception.
                    why = reason(error) if isinstance(error, DROPPED) else repr(error)
                    refusals.append(f"{topic}: {why}")
        self._scene.send_layout()
        self._delivers()
        return refusals

    def _delivers(self) -> bool:
        """Flush the recording; return False if Rerun has not accepted all data in time."""
        try:
            self._recording.flush(timeout_sec=FLUSH_TIME)
        except Exception:  # Also raised if the program has ended, which `Server` reports.
            now = time.monotonic()
            self._stalled_since = self._stalled_since or now
            waited = now - self._stalled_since
            if waited > STALL:
                self.problem = f"Rerun has taken no data for {waited:.0f} s"
            return False
        self._stalled_since, self.problem = None, ""
        return True
