# SPDX-License-Identifier: BSD-3-Clause
"""Services of nodes, which survive requests that fail."""

from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from ._failures import dropping
from ._throttle import LogThrottle


def offer_service(
    node: Node, kind: type, name: str, action: Callable[[Any, Any], None], log: LogThrottle
) -> None:
    """Offer the service `~/name`.

    An error of its action is logged, and so is a response that cannot be sent for lack of memory;
    then an empty response is sent.

    Args:
        node: the node.
        kind: class of the service.
        name: name of the service, below that of the node.
        action: called with the request and an empty response, which it fills.
        log: log of errors.
    """

    def respond(request: Any, response: Any) -> Any:
        with dropping(log, name):
            action(request, response)
            return response
        return service.srv_type.Response()

    def send(response: Any, header: Any) -> None:
        with dropping(log, name):
            send_once(response, header)
            return
        send_once(service.srv_type.Response(), header)

    service = node.create_service(kind, f"~/{name}", respond)
    send_once = service.send_response
    service.send_response = send  # type: ignore[method-assign]
