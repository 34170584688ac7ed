# SPDX-License-Identifier: BSD-3-Clause
"""Errors after which a node goes on."""

from collections.abc import Iterator
from contextlib import contextmanager

from rclpy.impl.implementation_singleton import rclpy_implementation

from ..errors import DROPPED, NodeFailedError, reason
from ._throttle import LogThrottle


def is_out_of_memory(error: Exception) -> bool:
    """Return whether an error may come from lack of memory.

    If there is none for a message, its conversion to or from Python raises a plain RuntimeError,
    and sending it an RCLError, which may have other causes as well.
    """
    if isinstance(error, MemoryError | rclpy_implementation.RCLError):
        return True
    return str(error).startswith(("unable to create ", "Unable to convert call argument "))


@contextmanager
def dropping(log: LogThrottle, what: str) -> Iterator[None]:
    """Log `what` with the reason if the context raises a `GridMapError`, or memory runs out.

    A `NodeFailedError` and all other exceptions pass.
    """
    try:
        yield
    except NodeFailedError:
        raise
    except (*DROPPED, RuntimeError) as error:
        if not (isinstance(error, DROPPED) or is_out_of_memory(error)):
            raise
        log.error(f"{what}: {reason(error)}")
