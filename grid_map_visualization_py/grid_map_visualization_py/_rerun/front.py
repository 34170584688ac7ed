# SPDX-License-Identifier: BSD-3-Clause
"""The address at which browsers reach Rerun: it checks who asks, and passes the request on.

The program `rerun` answers pages of every program on this machine and of rerun.io, under any name
of the host, and its page loads a font from another site. Behind this address, a page gets data from
the address that it came from, and nothing from elsewhere.
"""

import asyncio
import io
import re
import secrets
import socket
import threading
from asyncio import StreamReader as Reader, StreamWriter as Writer
from collections.abc import Container
from contextlib import suppress
from http.client import HTTPException, HTTPMessage, parse_headers
from urllib.parse import parse_qs, urlencode, urlsplit

from .._viewer.gate import is_allowed

POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; connect-src 'self' data: blob:; "
    "worker-src 'self' blob:; frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
)
"""Policy of the page: it loads nothing from another address, and no other page embeds it."""

FOREIGN_LINKS = re.compile(rb"<link\b[^>]*\bhttps?://[^>]*>")
"""Links of Rerun's page to other sites; browsers follow some in spite of the policy."""

PROGRAMS = b"PRI * HTTP/2.0\r\n\r\n"
"""Beginning of a connection of a program, such as Rerun's own viewer, which no browser can send."""

WATCH = """<script>
(async () => {
  for (let first; ; await new Promise((resolve) => setTimeout(resolve, 1000))) {
    try {
      const instance = await (await fetch("/instance")).text();
      first ??= instance;
      if (instance !== first) location.reload();
    } catch {}
  }
})();
</script>
"""
"""Part of the page that loads it again after a restart; Rerun's page would stand still."""

DATA = "/rerun."
"""Beginning of the paths of the data."""

MOST_CONNECTIONS = 64
"""Largest number of open connections; a page has one for the data, and two while it loads."""

PATIENCE = 10.0
"""Maximum time for the head of a request [s]."""

BUFFER, STEP = 8_000_000, 250_000
"""Size of the data that may wait for a slow page, and of what it has to take [bytes] ..."""

STALL = 10.0
"""... in this time [s]; otherwise its connection ends, since Rerun would stop for all pages."""

ENDS = OSError, EOFError, ValueError, HTTPException, asyncio.CancelledError
"""Ends of connections: at any time, by requests that make no sense, and when the page ends."""

Address = tuple[str, int]


class Front:
    """Answers requests in a thread of its own.

    Args:
        listener: the socket that listens.
        names: names under which browsers may open the page; see `is_allowed`.
        data: address of the data of Rerun.
        page: address of its page.
    """

    def __init__(
        self, listener: socket.socket, names: Container[str], data: Address, page: Address
    ) -> None:
        self._names, self._data, self._page = names, data, page
        self._open, self._instance = 0, secrets.token_hex(8)
        self._loop, self._end = asyncio.new_event_loop(), asyncio.Event()
        self._thread = threading.Thread(target=self._run, args=[listener], daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Close all connections."""
        self._loop.call_soon_threadsafe(self._end.set)
        self._thread.join()

    def _run(self, listener: socket.socket) -> None:
        # At the end, it cancels what is still open.
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._serve(listener))

    async def _serve(self, listener: socket.socket) -> None:
        server = await asyncio.start_server(self._accept, sock=listener)
        await self._end.wait()
        server.close()

    async def _accept(self, reader: Reader, writer: Writer) -> None:
        self._open += 1
        try:
            if self._open <= MOST_CONNECTIONS:
                with suppress(*ENDS):
                    await self._answer(reader, writer)
        finally:
            self._open -= 1
            writer.close()

    async def _answer(self, reader: Reader, writer: Writer) -> None:
        async with asyncio.timeout(PATIENCE):
            head = await reader.readuntil(b"\r\n\r\n")
        if head == PROGRAMS:
            await _pass_on(head, reader, writer, self._data)
            return
        line, _, rest = head.partition(b"\r\n")
        method, target, _ = line.decode("latin-1").split(" ")
        headers = parse_headers(io.BytesIO(rest))
        if not is_allowed(headers, self._names):
            text = "The page is not served under this name, or to another page.\n"
            writer.write(_reply("403 Forbidden", text.encode(), "text/plain"))
        elif target.startswith(DATA):
            await _pass_on(_request(method, target, headers), reader, writer, self._data)
        elif target == "/instance":
            writer.write(_reply("200 OK", self._instance.encode(), "text/plain"))
        elif urlsplit(target).path == "/":
            writer.write(await self._index(target, headers["Host"]))
        else:
            await _pass_on(_request(method, target, headers), reader, writer, self._page)
        await writer.drain()

    async def _index(self, target: str, host: str) -> bytes:
        """Return the page of Rerun, or the way to the address that names the data as well."""
        query = urlsplit(target).query
        if "url" not in parse_qs(query):
            data = urlencode({"url": f"rerun+http://{host}/proxy", "hide_welcome_screen": 1})
            place = f"Location: /?{data}{'&' * bool(query)}{query}"
            return _reply("302 Found", b"", "text/plain", place)
        reader, writer = await asyncio.open_connection(*self._page)
        writer.write(b"GET / HTTP/1.0\r\n\r\n")
        _, _, page = (await reader.read(-1)).partition(b"\r\n\r\n")
        writer.close()
        page = FOREIGN_LINKS.sub(b"", page).replace(b"</head>", WATCH.encode() + b"</head>")
        policy = f"Content-Security-Policy: {POLICY}"
        return _reply("200 OK", page, "text/html; charset=utf-8", policy)


def _reply(status: str, body: bytes, kind: str, *headers: str) -> bytes:
    lines = f"HTTP/1.1 {status}", f"Content-Type: {kind}", f"Content-Length: {len(body)}", *headers
    return "\r\n".join((*lines, "Connection: close", "", "")).encode("latin-1") + body


def _request(method: str, target: str, headers: HTTPMessage) -> bytes:
    """Return the head of a request, after whose answer the connection ends."""
    del headers["Connection"]
    headers["Connection"] = "close"
    lines = (f"{name}: {value}" for name, value in headers.items())
    return "\r\n".join((f"{method} {target} HTTP/1.1", *lines, "", "")).encode("latin-1")


async def _pass_on(head: bytes, reader: Reader, writer: Writer, address: Address) -> None:
    """Send the head and what follows to an address, and its answer back, until one side ends."""
    answer, question = await asyncio.open_connection(*address)
    question.write(head)
    ways = {asyncio.ensure_future(_copy(*way)) for way in ((reader, question), (answer, writer))}
    try:
        await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for way in ways:
            way.cancel()
        await asyncio.gather(*ways, return_exceptions=True)
        question.close()


async def _copy(reader: Reader, writer: Writer) -> None:
    writer.transport.set_write_buffer_limits(high=BUFFER, low=BUFFER - STEP)
    while block := await reader.read(1 << 16):
        writer.write(block)
        try:
            async with asyncio.timeout(STALL):
                await writer.drain()
        except TimeoutError:
            writer.transport.abort()
            return
