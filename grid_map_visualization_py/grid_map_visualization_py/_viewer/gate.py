# SPDX-License-Identifier: BSD-3-Clause
"""Checks of a page: it accepts requests of the page itself, and messages whose values make sense.

viser answers every page that is open in a browser which can reach it, and stores what that sends,
as fast as it comes.
"""

import asyncio
import ipaddress
import logging
import struct
import time
from collections import deque
from collections.abc import Callable, Container, Mapping
from contextlib import suppress
from http import HTTPStatus
from http.client import HTTPMessage
from typing import Any
from urllib.parse import urlsplit

from grid_map_core_py._parameters import cast
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.limits import check_cells
from grid_map_core_py.plugins import check

LARGEST = 1e12
"""Largest absolute value of the coordinates of a camera or a ray [m]."""

CAMERA = dict.fromkeys(("position", "look_at", "up_direction"), 3) | dict.fromkeys(
    ("fov", "near", "far", "image_height", "image_width"), 1
)
"""Fields of a camera, and how many numbers each has, besides the four of `wxyz`."""

MOST_PER_SECOND = 200.0
"""Largest mean rate of the messages of a connection [Hz].

The page sends the camera and clicks at most at 50 Hz each, and a control at 20 Hz.
"""

LARGEST_MESSAGE = 10_000
"""Largest size of a message that is not a picture [bytes].

Decoding makes an object of each byte in the worst case, while the page answers no other browser.
"""

LARGEST_PICTURE = 16_000_000
"""Largest size of a message of any kind; a larger one closes the connection [bytes]."""

MOST_CONNECTIONS = 32
"""Largest number of open connections; each page in a browser has one."""

MOST_WAITING = 1
"""Number of parts of messages that a connection holds before it stops reading.

A connection may thus hold three messages of the largest size: an unfinished one, and two finished
ones, since it stops when the part beyond this number is there.
"""

BURST = 1.0
"""Time that a connection may be ahead of this rate [s]."""


class Pace:
    """Limit of the rate of the messages of one connection (a token bucket).

    Args:
        clock: returns the time [s].
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._paid = clock()

    def wait(self) -> float:
        """Return how long to wait before the next message is read [s], and count that message."""
        now = self._clock()
        self._paid = max(self._paid, now) + 1 / MOST_PER_SECOND
        return max(0.0, self._paid - now - BURST)


class Gate:
    """Replacement of `serve` of websockets that refuses foreign pages and senseless messages.

    A connection that sends faster than `MOST_PER_SECOND` is read slowly, which makes it wait; no
    message is lost while it stays open. Connections beyond `MOST_CONNECTIONS` are refused; pages
    try again by themselves.

    Args:
        websockets: the module `websockets.asyncio.server`.
        msgspec: the module of that name.
        protocol: name of the protocol that the page asks for; it has the version of viser.
        names: names under which browsers may open the page; see `is_allowed`.

    Attributes:
        serve: the replaced function.
        is_used: the server has called the replacement.
        controls: controls of the page by identifier.
        open: connections of the pages that are open.
        refusals: reasons for which the last messages were refused.
    """

    def __init__(self, websockets: Any, msgspec: Any, protocol: str, names: Container[str]) -> None:
        self.serve = websockets.serve
        self.is_used = False
        self.controls: dict[str, Any] = {}
        self.refusals: deque[str] = deque(maxlen=100)
        self._connection = _checked(websockets.ServerConnection, self)
        fields = [("type", str), ("render_uuid", str), ("payload", bytes)]
        picture = msgspec.defstruct("Picture", fields, forbid_unknown_fields=True)
        self._decode_picture = msgspec.msgpack.Decoder(picture).decode
        self._decode, self._fields = msgspec.msgpack.decode, msgspec.structs.asdict
        self._protocol, self._names = protocol, names
        self.open: set[Any] = set()

    def __call__(self, handle: Any, *args: Any, process_request: Any, **options: Any) -> Any:
        async def handle_and_note(connection: Any) -> None:
            if connection.subprotocol != self._protocol:
                # viser would print the name, of any length, each time.
                why = f"expected the protocol {self._protocol}"
                self.note("a connection was closed", GridMapError(why))
                await connection.close(1002, f"Version mismatch: {why}")
                return
            try:
                await handle(connection)
            except Exception as error:  # The library of the page may raise anything.
                self.note("a connection was closed", error)

        def check_first(connection: Any, request: Any) -> Any:
            if refusal := self._refusal(connection, request.headers):
                return connection.respond(*refusal)
            return process_request(connection, request)

        self.is_used = True
        options |= {"process_request": check_first, "create_connection": self._connection}
        options |= {"max_size": LARGEST_PICTURE, "max_queue": MOST_WAITING}
        # By default, it logs a traceback of each connection that sends no HTTP.
        options["logger"] = logging.Logger("web_viewer", logging.WARNING)
        options["logger"].addHandler(_Notes(self))
        return self.serve(handle_and_note, *args, **options)

    def _refusal(
        self, connection: Any, headers: Mapping[str, str]
    ) -> tuple[HTTPStatus, str] | None:
        """Return why a connection is refused, or None; count it if it becomes a websocket."""
        if not is_allowed(headers, self._names):
            text = "The page is not served under this name, or to another page.\n"
            return HTTPStatus.FORBIDDEN, text
        if "Upgrade" not in headers:
            return None
        if len(self.open) >= MOST_CONNECTIONS:
            text = f"more than {MOST_CONNECTIONS} pages are open"
            self.note("a connection was refused", GridMapError(text))
            return HTTPStatus.SERVICE_UNAVAILABLE, f"{text}\n"
        self.open.add(connection)
        return None

    async def keep_pace(self, pace: Pace) -> None:
        """Wait until the next message of a connection may be read."""
        if wait := pace.wait():
            limit = f"more than {MOST_PER_SECOND:g} messages per second"
            self.note("a browser has to wait", GridMapError(limit))
            await asyncio.sleep(wait)

    def accepts(self, data: Any) -> bool:
        """Return whether a message of a browser makes sense; otherwise, note why not."""
        try:
            is_small = len(data) <= LARGEST_MESSAGE
            message = self._decode(data) if is_small else self._fields(self._decode_picture(data))
            self._check(message)
        except Exception as error:  # Messages may hold anything.
            self.note("ignored a message of a browser", error)
            return False
        return True

    def note(self, what: str, error: BaseException) -> None:
        """Remember what was refused, and why."""
        why = str(error) if isinstance(error, GridMapError) else repr(error)
        self.refusals.append(f"{what}: {why}")

    def _check(self, message: Any) -> None:
        kind = message["type"]
        if kind == "GuiUpdateMessage":
            control, updates = self.controls.get(message["uuid"]), message["updates"]
            check(control is not None, "uuid", "a control of the page", message["uuid"])
            # The server would set other attributes of its own, too.
            check([*updates] == ["value"], "updates", "a value", updates)
            check_value(control, updates["value"])
        elif kind == "ViewerCameraMessage":
            for name, count in {"wxyz": 4, **CAMERA}.items():
                _check_numbers(name, message[name], count)
        elif kind == "ScenePointerMessage":
            check(message["event_type"] == "click", "event_type", "'click'", message["event_type"])
            for name in ("ray_origin", "ray_direction"):
                _check_numbers(name, message[name], 3)
            direction = message["ray_direction"]
            check(any(direction), "ray_direction", "a direction", direction)
            (place,) = message["screen_pos"]
            _check_numbers("screen_pos", place, 2)
            cast("modifier", message["modifier"], str | None)
        elif kind == "GetRenderResponseMessage":
            cast("render_uuid", message["render_uuid"], str)
            _check_picture(message["payload"])
        else:
            check(False, "type", "a message of the page", kind)


class _Notes(logging.Handler):
    """Gives what websockets logs to a gate."""

    def __init__(self, gate: Gate) -> None:
        super().__init__()
        self._gate = gate

    def emit(self, record: logging.LogRecord) -> None:
        _, error, _ = record.exc_info or (None, None, None)
        self._gate.note(record.getMessage(), error or GridMapError("no page"))


def _checked(base: Any, gate: Gate) -> Any:
    """Return a class of connections that give only messages which the gate accepts."""

    class Connection(base):  # type: ignore[misc]
        def __init__(self, *args: Any, **options: Any) -> None:
            super().__init__(*args, **options)
            self.pace = Pace()

        async def recv(self, *args: Any, **options: Any) -> Any:
            await gate.keep_pace(self.pace)
            while not gate.accepts(data := await super().recv(*args, **options)):
                await gate.keep_pace(self.pace)
            return data

        def connection_lost(self, error: Exception | None) -> None:
            gate.open.discard(self)
            super().connection_lost(error)

    return Connection


def check_value(control: Any, value: object) -> None:
    """Raise `ConfigError` unless a value is possible for a control.

    Args:
        control: a control of viser. Its value has the right type, and numbers have bounds.
        value: what a browser has sent.
    """
    name, before = control.label, control.value
    if isinstance(before, tuple):
        levels = cast(name, value, list[int])
        is_color = len(levels) == len(before) and all(0 <= level <= 255 for level in levels)
        check(is_color, name, f"{len(before)} integers from 0 to 255", value)
        return
    typed = cast(name, value, type(before))
    if isinstance(typed, str):
        check(typed in control.options, name, "one of its options", value)
    elif not isinstance(typed, bool):
        low, high = control.min, control.max
        # NaN is not between them.
        check(low <= typed <= high, name, f"a number from {low:g} to {high:g}", value)


def _check_numbers(name: str, value: Any, count: int) -> None:
    numbers = [value] if count == 1 else value
    are_numbers = len(numbers) == count and all(
        type(number) in (int, float) and abs(number) <= LARGEST for number in numbers
    )
    check(are_numbers, name, f"{count} finite numbers up to {LARGEST:g}", value)


def _check_picture(data: Any) -> None:
    """Check the head of a picture, which is decoded later; an empty one says that there is none."""
    if data != b"":
        head, width, height = struct.unpack_from(">16sII", data)
        is_png = head == b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"
        check(is_png, "payload", "a picture in PNG", data)
        check_cells("payload", (height, width))


def is_allowed(headers: Mapping[str, str] | HTTPMessage, names: Container[str]) -> bool:
    """Return True if a browser may send a request with these headers to the page.

    The host must be an address or one of the names, so that a foreign name that is made to point to
    this machine (DNS rebinding) is refused. The origin must be the page itself.
    """
    host = headers.get("Host", "").lower()
    # Programs other than browsers send no origin; those on this machine could read the topic, too.
    origin = headers.get("Origin", f"http://{host}")
    try:
        name = urlsplit(f"//{host}").hostname or ""
        is_same = urlsplit(origin).netloc.lower() == host
    except ValueError:
        return False
    with suppress(ValueError):
        ipaddress.ip_address(name)
        return is_same
    return is_same and name in names
