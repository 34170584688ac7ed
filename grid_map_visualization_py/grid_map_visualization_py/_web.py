# SPDX-License-Identifier: BSD-3-Clause
"""Page URLs of the web viewer and the Rerun viewer, and checks of page requests."""

import ipaddress
import socket
from collections.abc import Container, Mapping, Sequence
from contextlib import suppress
from http.client import HTTPMessage
from urllib.parse import urlsplit

from grid_map_core_py.errors import GridMapError


class PageError(GridMapError):
    """The page cannot be served."""


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens at an address; raise `PageError` on failure."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host, port), family=family)
    except (OSError, OverflowError) as error:
        text = f"the page cannot be served at {host}:{port}: {error}; choose another host or port"
        raise PageError(text) from error


def is_loopback(host: str) -> bool:
    """Return True if an address is reachable from this machine only."""
    with suppress(ValueError):
        return ipaddress.ip_address(host).is_loopback
    return host == "localhost"


def url_of(host: str, port: int) -> str:
    """Return the URL of a page; the machine name replaces wildcard addresses."""
    name = socket.gethostname() if host in {"", "0.0.0.0", "::"} else host
    return f"http://[{name}]:{port}" if ":" in name else f"http://{name}:{port}"


def names_of(host: str, allowed_hosts: Sequence[str]) -> set[str]:
    """Return the host names under which browsers may open a page at `host`."""
    machine = socket.gethostname()
    names = {host, "localhost", machine, f"{machine}.local", *allowed_hosts}
    return {name.lower() for name in names}


def is_allowed(headers: Mapping[str, str] | HTTPMessage, names: Container[str]) -> bool:
    """Return True if the page may answer a request with these headers.

    `Host` must be an IP address or one of `names`. This rule prevents DNS rebinding (foreign names
    that resolve to this machine). `Origin`, which only browsers send, may be missing. Otherwise, it
    must be the page itself.
    """
    host = headers.get("Host", "").lower()
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
