# SPDX-License-Identifier: BSD-3-Clause
"""Entry point of the command line, and its signal handling."""

import argparse
import ctypes
import logging
import os
import re
import signal
import sys
import warnings
from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from types import FrameType
from typing import Any, NoReturn, TypeAlias

from .. import __version__
from .._unfinished import notes, remove_all
from ..errors import GridMapError, hint
from ..limits import Limits, set_limits
from ._output import CommandError, UsageError, message, shown

PROGRAM = "grid-map"
GROUP = "grid_map_core_py.commands"

BUILT_IN = ("info", "inspect", "convert", "submap", "path", "doctor")

HELP = {
    "info": "show the contents of a file: topics, layers, size, position and time",
    "inspect": "show range, mean, missing values and histogram of every layer",
    "convert": "convert maps between file formats; make maps from clouds, meshes and height images",
    "submap": "cut a rectangle out of a map of any size",
    "path": "print the length and cost of the least-cost path between two positions, and draw it",
    "doctor": "show versions, missing or broken packages, and the settings of ROS and DDS",
    "filter": "run a filter chain on a map of any size, or on all maps of a bag",
    "plot": "draw a map to a PNG, JPEG, PDF or SVG file, or the maps of a bag to a video",
    "view": "show a map, or all messages of a bag, in Rerun in the browser, until Ctrl-C",
    "topics": "list the topics of running nodes (needs ROS 2)",
    "record": "record topics of any type to a bag, until Ctrl-C (needs ROS 2)",
    "play": "publish the messages of a bag at the pace of the recording (needs ROS 2)",
}
"""Help texts of the suite's commands; `grid-map --help` shows them without importing commands."""

_NO_READER = 128 + signal.SIGPIPE

Handler: TypeAlias = Callable[[int, FrameType | None], Any] | signal.Handlers


class Parser(argparse.ArgumentParser):
    """Argument parser with one-line error messages, which accepts values such as -1e-3."""

    def __init__(self, **options: Any) -> None:
        # An abbreviated option that is unique today may become ambiguous when an option is added.
        super().__init__(allow_abbrev=False, **options)
        self._negative_number_matcher = re.compile(r"-\.?\d|-inf(inity)?$")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            known = f"{', '.join(map(str, action.choices))}{hint(value, map(str, action.choices))}"
            raise argparse.ArgumentError(action, f"invalid choice: {value!r}; known: {known}")

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{PROGRAM}: error: {shown(message)} (see '{self.prog} --help')\n")


def make_parser(words: Sequence[str]) -> Parser:
    """Create the parser; only the command in `words` is imported, to save time."""
    parser = Parser(
        prog=PROGRAM, description="Look at grid maps in files, convert, filter and draw them."
    )
    parser.add_argument("--version", action="version", version=f"{PROGRAM} {__version__}")
    subparsers = parser.add_subparsers(metavar="command", required=True)
    commands = _commands()
    wanted = next((word for word in words if word in commands), None)
    for name, entry in commands.items():
        text = HELP.get(name, f"command of {entry.value}")
        command = subparsers.add_parser(name, help=text)
        if name == wanted:
            try:
                module = entry.load()
            # A plug-in may raise any error; it is reported with the name of the plug-in.
            except Exception as error:
                remedy = ". Source ROS 2, then the workspace" if "needs ROS 2" in text else ""
                text = f"{name}: the command of {entry.value} cannot be loaded: {error}"
                raise CommandError(text + remedy) from error
            command.description = (module.__doc__ or "").partition("\n")[0]
            module.add_arguments(command)
            command.set_defaults(run=module.run, parser=command)
    return parser


def _commands() -> dict[str, EntryPoint]:
    """Return all commands by name; built-in commands override those of other packages."""
    known = {name: EntryPoint(name, f"{__package__}.{name}", GROUP) for name in BUILT_IN}
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        known.setdefault(entry.name, entry)
    return known


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line and return its exit code."""
    before = on_end(_end)
    logging.basicConfig(format=f"{PROGRAM}: %(message)s")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always", UserWarning)
            # The warning filter "once" would show a warning once per module.
            once = cache(lambda text: message(f"warning: {text}"))
            warnings.showwarning = lambda warning, *_, **__: once(str(warning))
            return _run(sys.argv[1:] if arguments is None else arguments)
    except OSError as error:
        # Standard output is broken. Redirect it, because Python flushes it again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return _NO_READER if isinstance(error, BrokenPipeError) else _failed(_text_of(error))
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _end(number: int, _frame: FrameType | None) -> None:
    """Signal handler: remove temporary files, then end the process with the same signal."""
    remove_all()
    for note in notes:
        # The signal may have interrupted `print`, which is not reentrant.
        os.write(2, ("\n" * os.isatty(2) + f"{PROGRAM}: {note}\n").encode())
    signal.signal(number, signal.SIG_DFL)
    signal.raise_signal(number)


def _run(arguments: Sequence[str]) -> int:
    parser: Parser | None = None
    notes.clear()
    try:
        completing = "_ARGCOMPLETE" in os.environ
        words = os.environ.get("COMP_LINE", "").split() if completing else arguments
        parser = make_parser(words)
        if completing:
            argcomplete: Any = import_module("argcomplete")
            argcomplete.autocomplete(parser)  # ends the process
        if not arguments:
            parser.print_help(sys.stderr)
            return 2
        options, unknown = parser.parse_known_args(arguments)
        parser = options.parser
        if unknown:
            similar = hint(unknown[0], parser._option_string_actions)
            parser.error(f"unrecognized arguments: {' '.join(unknown)}{similar}")
        given = {field.name: getattr(options, field.name, None) for field in fields(Limits)}
        before = set_limits(**{name: value for name, value in given.items() if value is not None})
        try:
            return int(options.run(options))
        finally:
            set_limits(before)
    except BrokenPipeError:
        raise
    except Exception as error:
        if isinstance(error, UsageError) and parser is not None:
            parser.error(str(error))
        return _failed(_text_of(error))
    finally:
        if sys.stdout:
            sys.stdout.flush()


def _text_of(error: Exception) -> str:
    """Return the message of an expected error; raise other errors again."""
    if "AMENT_PREFIX_PATH" in str(error):
        return f"{error}. Source ROS 2, then the workspace"
    if isinstance(error, OSError):
        return ": ".join(str(part) for part in (error.filename, error.strerror or error) if part)
    if isinstance(error, GridMapError | MemoryError):
        return str(error) or "out of memory"
    if isinstance(error, ModuleNotFoundError):
        return f"{error}; '{PROGRAM} doctor' tells what is missing"
    raise error


def _failed(text: str) -> int:
    message(f"error: {' '.join('. '.join([text, *notes]).split())}")
    return 1


def on_end(handler: Handler) -> dict[signal.Signals, Any]:
    """Set a handler for SIGINT, SIGTERM and SIGHUP, and return the previous handlers.

    The handler must not acquire locks, because the interrupted thread may hold them.
    """
    numbers = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # `nohup` ignores SIGHUP.
        numbers.append(signal.SIGHUP)
    return {number: signal.signal(number, handler) for number in numbers}


def die_with_parent(number: signal.Signals = signal.SIGKILL) -> Callable[[], None]:
    """Return a `preexec_fn` for Linux that signals a child process when its parent ends."""
    set_parent_death_signal = 1
    # libc is loaded before the fork, because the child should do little before it calls `exec`.
    parent, control = os.getpid(), ctypes.CDLL(None).prctl

    def prepare() -> None:
        control(set_parent_death_signal, number)
        # The parent may have ended already. In a container, the parent itself may be process 1.
        if os.getppid() != parent:
            os._exit(0)

    return prepare
