# SPDX-License-Identifier: BSD-3-Clause
"""List the topics of running nodes."""

import argparse
from typing import Any

from grid_map_core_py._commands import add_json, message, print_json, print_table

from ._session import Session, check_positive, offers

_STEP = 0.1
_CALM_STEPS = 5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    text = "longest time to look for nodes [s] (%(default)s)"
    parser.add_argument("--wait", type=float, default=3.0, help=text)
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Print the topics with their types, publishers and subscribers."""
    check_positive(options, "wait")
    with Session("topics") as session:
        found: list[dict[str, Any]] = []
        calm = 0
        for _ in range(int(options.wait / _STEP) + 1):
            session.spin(_STEP)
            before, found = found, _topics(session)
            calm = calm + 1 if found and found == before else 0
            if calm >= _CALM_STEPS or session.ended:
                break
    if options.json:
        print_json(found)
    elif found:
        head = ("topic", "type", "publishers", "subscribers", "offered")
        print_table([head, *map(_row, found)], numbers=(2, 3))
    else:
        message(f"no topics within {options.wait:g} s")
    return 0


def _topics(session: Session) -> list[dict[str, Any]]:
    topics = [
        {
            "name": name,
            "types": types,
            "publishers": [_endpoint(one) | offers(one) for one in session.publishers(name)],
            "subscribers": [_endpoint(one) for one in session.subscribers(name)],
        }
        for name, types in session.topics().items()
    ]
    return [topic for topic in topics if topic["publishers"] or topic["subscribers"]]


def _endpoint(info: Any) -> dict[str, Any]:
    return {"node": f"{info.node_namespace.rstrip('/')}/{info.node_name}"}


def _row(topic: dict[str, Any]) -> tuple[str, ...]:
    offered = {
        ("reliable" if one["reliable"] else "best effort") + (", latched" if one["latched"] else "")
        for one in topic["publishers"]
    }
    counts = (str(len(topic[side])) for side in ("publishers", "subscribers"))
    return (topic["name"], ", ".join(topic["types"]), *counts, " | ".join(sorted(offered)))
