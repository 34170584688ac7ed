# SPDX-License-Identifier: BSD-3-Clause
"""The server of recordings: the program `rerun` and real sockets."""

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, closing, suppress
from http.client import HTTPConnection
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest

from grid_map_core_py.errors import MissingPackageError
from grid_map_ros_py.testing import wait_until
from grid_map_visualization_py._rerun import server as module
from grid_map_visualization_py._rerun.server import Server
from grid_map_visualization_py._web import PageError

pytestmark = pytest.mark.needs("rerun")

DATA = "/rerun.sdk_comms.v1alpha1.MessageProxyService/ReadMessages"
QUESTION = b"\0\0\0\0\0"
"""An empty message, framed for a page."""

MAKE = """
import sys
from grid_map_visualization_py._rerun.server import Server
server = Server(port=0)
server.recording.set_time("ros_time", timestamp=1.0)
server.recording.log_file_from_contents("note.txt", b"A text.")
server.recording.flush(timeout_sec=100)
print(server._process.pid, server.page_url, flush=True)
sys.stdin.read()
"""


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with closing(Server(port=0, allowed_hosts=["robot"])) as one:
        one.recording.log_file_from_contents("note.txt", b"A text.")
        one.recording.flush(timeout_sec=100)
        yield one


def ask(server: Server, path: str, method: str = "GET", **headers: str) -> tuple[int, Any, bytes]:
    """Return status, headers and the first bytes of an answer."""
    connection = HTTPConnection(urlsplit(server.page_url).netloc, timeout=100)
    # A dash stands for the character that names of arguments cannot have.
    words = {name.replace("_", "-"): value for name, value in headers.items()}
    words |= {"Content-Type": "application/grpc-web+proto"}
    connection.request(method, path, QUESTION if method == "POST" else None, words)
    answer = connection.getresponse()
    return answer.status, answer.headers, answer.read1(1 << 20)


def sockets_of(*pids: int) -> list[tuple[str, str, str]]:
    """Return local address, remote address and state of the Internet sockets of processes."""
    links = [link for pid in pids for link in Path(f"/proc/{pid}/fd").iterdir()]
    nodes = {str(link.readlink()) for link in links if link.is_symlink()}
    found = []
    for name in ("tcp", "tcp6", "udp", "udp6"):
        for line in Path(f"/proc/net/{name}").read_text().splitlines()[1:]:
            _, local, remote, state, *_, inode = line.split()[:10]
            if f"socket:[{inode}]" in nodes:
                found.append((address_of(local), address_of(remote), state))
    return found


def address_of(text: str) -> str:
    number = bytes.fromhex(text.partition(":")[0])
    if len(number) == 4:
        return socket.inet_ntop(socket.AF_INET, number[::-1])
    words = b"".join(number[at : at + 4][::-1] for at in range(0, 16, 4))
    return socket.inet_ntop(socket.AF_INET6, words)


@pytest.fixture
def started(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], int, str]]:
    """A program that serves, with a home of its own; the process of `rerun`; and the address."""
    variables = {**os.environ, "HOME": str(tmp_path), "XDG_CONFIG_HOME": "", "XDG_DATA_HOME": ""}
    # Where it is set, Rerun writes nothing.
    variables.pop("CI", None)
    with subprocess.Popen(
        [sys.executable, "-c", MAKE],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=variables,
    ) as program:
        pid, url = program.stdout.readline().split()
        yield program, int(pid), url
        program.kill()


def test_server_listens_and_connects_on_this_machine_only(server):
    ask(server, "/")
    found = sockets_of(server._process.pid, os.getpid())
    listening = {local for local, _, state in found if state == "0A"}
    assert "127.0.0.1" in listening
    assert all(address.startswith("127.") for address in listening)
    remotes = {remote for _, remote, state in found if state != "0A"}
    assert remotes
    assert all(address.startswith(("127.", "0.0.0.0")) for address in remotes)


def test_first_session_is_silent_and_leaves_the_home_empty(started, tmp_path):
    program, pid, _ = started
    assert all(remote.startswith(("127.", "0.")) for _, remote, _ in sockets_of(program.pid, pid))
    assert program.communicate()[0] == ""
    assert list(tmp_path.rglob("*")) == []


def test_program_ends_with_a_parent_that_is_killed(started):
    program, pid, _ = started
    os.kill(pid, signal.SIGSTOP)
    program.send_signal(signal.SIGKILL)
    # As a zombie, it has no memory.
    status = Path(f"/proc/{pid}/status")
    wait_until(lambda: not status.exists() or "VmRSS" not in status.read_text(), "the end")


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 200),
        ({"Origin": "http://{own}"}, 200),
        ({"Host": "robot", "Origin": "http://robot"}, 200),
        ({"Host": "example.org"}, 403),
        ({"Origin": "http://127.0.0.1:1"}, 403),
        ({"Origin": "https://rerun.io"}, 403),
    ],
)
def test_only_the_own_page_gets_the_data(server, headers, status):
    own = urlsplit(server.page_url).netloc
    given = {name: value.format(own=own) for name, value in headers.items()}
    for path, method in ((DATA, "POST"), (DATA, "OPTIONS"), ("/re_viewer.js", "GET")):
        found, answer, _ = ask(server, path, method, **given)
        assert found == status
        # The program itself answers 127.0.0.1 of any port, and rerun.io.
        assert answer["Access-Control-Allow-Origin"] in {None, f"http://{own}", "http://robot"}


def test_page_names_its_data_and_keeps_options(server):
    status, answer, _ = ask(server, "/?renderer=webgl", Host="localhost:1234")
    assert status == 302
    assert "url=rerun%2Bhttp%3A%2F%2Flocalhost%3A1234%2Fproxy" in answer["Location"]
    assert answer["Location"].endswith("&renderer=webgl")
    status, _, page = ask(server, answer["Location"])
    assert status == 200
    assert b"re_viewer.js" in page


@pytest.mark.parametrize(
    "question", [b"nonsense\r\n\r\n", b"GET / HTTP/1.1\r\n\r\n", b"\0" * 99999]
)
def test_senseless_requests_end_their_connection_only(server, question):
    with socket.create_connection(address(server)) as connection:
        connection.sendall(question)
        connection.shutdown(socket.SHUT_WR)
        assert connection.recv(100)[9:12] in {b"", b"403"}
    assert ask(server, "/favicon.ico")[0] == 200


def address(server: Server) -> tuple[str, int]:
    parts = urlsplit(server.page_url)
    return parts.hostname, parts.port


def test_server_closes_while_the_program_hangs():
    with closing(Server(port=0)) as one:
        os.kill(one._process.pid, signal.SIGSTOP)
    assert one.problem == "the program rerun has ended with exit code -9"


def test_reader_that_takes_nothing_does_not_block_others(monkeypatch):
    import rerun

    monkeypatch.setattr(module, "STALL", 1.0)
    monkeypatch.setattr(module, "BUFFER", 1_000_000)
    monkeypatch.setattr(module, "STEP", 10_000)
    noise = np.random.default_rng(1).bytes(1_000_000)  # Rerun compresses what it sends.
    with closing(Server(port=0)) as one, ExitStack() as stack:
        question = f"POST {DATA} HTTP/1.1\r\nHost: 127.0.0.1\r\n".encode()
        question += b"Content-Type: application/grpc-web+proto\r\nContent-Length: 5\r\n\r\n"
        frozen, reader = (stack.enter_context(socket.socket()) for _ in "12")
        for connection in frozen, reader:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 16)
            connection.connect(address(one))
            connection.sendall(question + QUESTION)
        reader.settimeout(0.05)
        received = [0]

        def publish() -> None:
            one.recording.log("noise", rerun.AnyValues(noise=np.frombuffer(noise, np.uint8)))
            with suppress(TimeoutError):
                while data := reader.recv(1 << 20):
                    received[0] += len(data)

        def connections() -> int:
            return sum(state == "01" for _, _, state in sockets_of(os.getpid()))

        wait_until(lambda: received[0] > len(noise), "data", step=publish)
        both = connections()
        is_alone = lambda: connections() < both  # noqa: E731
        wait_until(is_alone, "the end of the other connection", step=publish)
        before = received[0]
        wait_until(lambda: received[0] > before + len(noise), "more data", step=publish)


def rerun() -> Path:
    """Return the program of Rerun."""
    import rerun_cli

    return Path(rerun_cli.__file__).with_name("rerun")


def test_errors_are_one_line(monkeypatch):
    with pytest.raises(PageError, match=r"has ended with exit code [12]; it says above why"):
        Server(port=0, memory_limit="much")
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(
        MissingPackageError, match=r"Rerun needs .* 'rerun', .*pip install rerun-sdk"
    ):
        Server(port=0)
