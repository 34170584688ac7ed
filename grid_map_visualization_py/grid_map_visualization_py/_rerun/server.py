# SPDX-License-Identifier: BSD-3-Clause
"""Serves a Rerun recording to browsers.

The program `rerun` also accepts requests from other web pages. Therefore, it runs at a random local
address, behind a relay that rejects such requests.
"""

import asyncio
import io
import os
import random
import socket
import subprocess
import threading
import time
from asyncio import StreamReader as Reader, StreamWriter as Writer
from collections.abc import Container, Sequence
from contextlib import suppress
from http.client import parse_headers
from pathlib import Path
from urllib.parse import urlencode

from grid_map_core_py._commands import die_with_parent

from .._web import PageError, is_allowed, is_loopback, listen, names_of, url_of
from .scene import rerun

SETTINGS = Path(__file__).with_name("settings")
"""Read-only settings folder that disables the usage statistics of the program `rerun`."""

START_TIME = 30.0
"""Maximum startup time of the program `rerun` [s]."""

FAREWELL = 0.3
"""Maximum time to send the last data to the program when the server closes [s]."""

BUFFER, STEP = 8_000_000, 250_000
"""Queue limit of a connection, and amount by which a full queue must shrink in `STALL` [bytes]."""

STALL = 10.0
"""Time within which a full queue must shrink by `STEP` bytes [s].

Slower connections are closed, because they would block all pages.
"""

Address = tuple[str, int]


class Server:
    """Serves a recording to browsers and to the native Rerun viewer.

    The thread that created the server must outlive it; otherwise, Linux ends the program `rerun`.

    Args:
        memory_limit: maximum size of the stored messages, such as `512MB` or `20%` (of all memory).
        allowed_hosts: additional host names under which browsers may open the page.

    Attributes:
        recording: a `rerun.RecordingStream`, whose methods may block while the program hangs.
        page_url: URL of the page; Rerun options such as `?renderer=webgl` may be appended.
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = 9876,
        *,
        memory_limit: str = "512MB",
        allowed_hosts: Sequence[str] = (),
    ) -> None:
        sdk, program = rerun(), rerun("rerun_cli")
        listener = listen(host, port)
        self.page_url = url_of(host, listener.getsockname()[1])
        self.is_public = not is_loopback(host)
        hidden = f"127.{random.randint(1, 254)}.{random.randint(1, 254)}.{random.randint(1, 254)}"
        data, page = ((hidden, number) for number in random.sample(range(10_000, 30_000), 2))
        self._process = subprocess.Popen(
            [
                *(str(Path(program.__file__).with_name("rerun")), "--serve-web", "--bind", hidden),
                *("--port", str(data[1]), "--web-viewer-port", str(page[1])),
                *("--server-memory-limit", memory_limit),
            ],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            env={**os.environ, "XDG_CONFIG_HOME": str(SETTINGS), "RUST_LOG": "warn"},
            # Ctrl-C must reach only this process, which then ends the program.
            start_new_session=True,
            preexec_fn=die_with_parent(),
        )
        try:
            for address in (data, page):
                self._wait_for(address)
        except BaseException:
            listener.close()
            self._process.kill()
            raise
        self.recording = sdk.RecordingStream("grid_map")
        self.recording.connect_grpc(f"rerun+http://{hidden}:{data[1]}/proxy")
        self._relay = _Relay(listener, names_of(host, allowed_hosts), data, page)

    @property
    def problem(self) -> str:
        """Error message if the program `rerun` has ended, or ""."""
        code = self._process.poll()
        return "" if code is None else f"the program rerun has ended with exit code {code}"

    def close(self) -> None:
        """Stop serving and end the program, even if it hangs."""
        self._relay.close()
        # The recording blocks while the program hangs; the timer then kills the program.
        last = threading.Timer(FAREWELL, self._process.kill)
        last.start()
        with suppress(Exception):  # Rerun may raise any exception.
            self.recording.disconnect()
        last.cancel()
        self._process.kill()
        self._process.wait()

    def _wait_for(self, address: Address) -> None:
        deadline = time.monotonic() + START_TIME
        while True:
            with suppress(OSError), socket.create_connection(address):
                return
            if self.problem:
                raise PageError(f"{self.problem}; it says above why")
            if time.monotonic() > deadline:
                raise PageError(f"the program rerun has not started within {START_TIME:g} s")
            time.sleep(0.02)


class _Relay:
    """Forwards requests to the data port or the page port of `rerun`, in its own thread."""

    def __init__(
        self, listener: socket.socket, names: Container[str], data: Address, page: Address
    ) -> None:
        self._names, self._data, self._page = names, data, page
        self._loop, self._end = asyncio.new_event_loop(), asyncio.Event()
        self._thread = threading.Thread(target=self._run, args=[listener], daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._loop.call_soon_threadsafe(self._end.set)
        self._thread.join()

    def _run(self, listener: socket.socket) -> None:
        async def serve() -> None:
            server = await asyncio.start_server(self._accept, sock=listener)
            await self._end.wait()
            server.close()

        # On exit, the runner cancels open connections.
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(serve())

    async def _accept(self, reader: Reader, writer: Writer) -> None:
        # Requests may be malformed, and connections may end at any time.
        with suppress(Exception, asyncio.CancelledError):
            await self._answer(reader, writer)
        writer.close()

    async def _answer(self, reader: Reader, writer: Writer) -> None:
        head = await reader.readuntil(b"\r\n\r\n")
        if head.startswith(b"PRI * HTTP/2.0\r\n"):
            # Only native programs, such as the Rerun viewer, can send this preface; pages cannot.
            await _pass_on(head, reader, writer, self._data, STALL)
            return
        line, _, rest = head.partition(b"\r\n")
        _, target, _ = line.decode("latin-1").split(" ")
        headers = parse_headers(io.BytesIO(rest))
        if not is_allowed(headers, self._names):
            text = "This host name is not allowed, or the request comes from another web page.\n"
            writer.write(_reply("403 Forbidden", text))
        elif target.startswith("/?url=") or (target != "/" and not target.startswith("/?")):
            del headers["Connection"]
            # The next request on this connection might have another origin.
            lines = (f"{name}: {value}" for name, value in headers.items())
            text = "\r\n".join((line.decode("latin-1"), *lines, "Connection: close", "", ""))
            # A slow browser may pause for a long time while it compiles the files of the page.
            is_data = target.startswith("/rerun.")
            way = (self._data, STALL) if is_data else (self._page, None)
            await _pass_on(text.encode("latin-1"), reader, writer, *way)
        else:
            # This URL option tells the page where to load the data.
            where = {"url": f"rerun+http://{headers['Host']}/proxy", "hide_welcome_screen": 1}
            rest_of_query = target[2:] and f"&{target[2:]}"
            place = f"Location: /?{urlencode(where)}{rest_of_query}"
            writer.write(_reply("302 Found", "", place))
        await writer.drain()


def _reply(status: str, text: str, *headers: str) -> bytes:
    lines = f"HTTP/1.1 {status}", "Content-Type: text/plain", f"Content-Length: {len(text)}"
    return "\r\n".join((*lines, *headers, "Connection: close", "", text)).encode("latin-1")


async def _pass_on(
    head: bytes, reader: Reader, writer: Writer, address: Address, patience: float | None
) -> None:
    """Forward `head` to `address`, then copy both ways until one side ends or stalls.

    A side stalls if its full queue does not shrink by `STEP` within `patience` [s].
    """

    async def copy(reader: Reader, writer: Writer) -> None:
        writer.transport.set_write_buffer_limits(high=BUFFER, low=BUFFER - STEP)
        while block := await reader.read(1 << 16):
            writer.write(block)
            try:
                await asyncio.wait_for(writer.drain(), patience)
            except TimeoutError:
                writer.transport.abort()
                return

    answer, question = await asyncio.open_connection(*address)
    question.write(head)
    ways = [asyncio.ensure_future(copy(*way)) for way in ((reader, question), (answer, writer))]
    try:
        await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for way in ways:
            way.cancel()
        await asyncio.gather(*ways, return_exceptions=True)
        question.close()
