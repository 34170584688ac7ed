# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""From the words of a command line to its exit code."""

import argparse
import os
import re
import signal
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any, NoReturn

from .errors import CommandError, UsageError
from .output import message

PROGRAM = "grid-map"
COMMANDS = ("info", "inspect", "convert", "filter", "plot", "view", "doctor")

_INTERRUPTED, _NOBODY_READS = 128 + signal.SIGINT, 128 + signal.SIGPIPE


class Parser(argparse.ArgumentParser):
    """Says what is wrong in one line, and takes numbers such as -1e-3 for values of options."""

    def __init__(self, **options: Any) -> None:
        # What is short for one option today may be short for two tomorrow.
        super().__init__(allow_abbrev=False, **options)
        self._negative_number_matcher = re.compile(r"-\.?\d|-inf(inity)?$")

    def error(self, message: str) -> NoReturn:
        """End the process."""
        self.exit(2, f"{PROGRAM}: error: {message} (see '{self.prog} --help')\n")


class _Version(argparse.Action):
    """Looks for the version only if somebody asks."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from importlib.metadata import PackageNotFoundError, version

        try:
            number = version("grid_map_demos_py")
        except PackageNotFoundError:
            number = "of a source folder that is not installed"
        print(PROGRAM, number)
        parser.exit()


def make_parser() -> Parser:
    """Return the parser of the whole command line."""
    parser = Parser(
        prog=PROGRAM, description="Look at grid maps in files, convert and filter them."
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    commands = parser.add_subparsers(metavar="command", required=True)
    for name in COMMANDS:
        module = import_module(f"{__package__}.{name}")
        command = commands.add_parser(
            name, help=module.HELP, description=f"{module.HELP[0].upper()}{module.HELP[1:]}."
        )
        module.add_arguments(command)
        command.set_defaults(run=module.run, parser=command)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line and return its exit code."""
    before = signal.signal(signal.SIGTERM, _terminate)
    try:
        return _run(arguments)
    except KeyboardInterrupt:
        return _INTERRUPTED
    except OSError as error:
        # Only standard output is left; Python would try once more when it ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        is_pipe = isinstance(error, BrokenPipeError)
        return _NOBODY_READS if is_pipe else _failed(_text_of(error))
    finally:
        signal.signal(signal.SIGTERM, before)


def _terminate(number: int, _: object) -> NoReturn:
    """End as after Ctrl-C, so that nothing unfinished is left behind."""
    sys.exit(128 + number)


def _run(arguments: Sequence[str] | None) -> int:
    try:
        parser = make_parser()
        _complete(parser)
        if not (sys.argv[1:] if arguments is None else arguments):
            parser.print_help(sys.stderr)
            return 2
        options, unknown = parser.parse_known_args(arguments)
        if unknown:
            options.parser.error(f"unrecognized arguments: {' '.join(unknown)}")
        return _carried_out(options.run, options)
    finally:
        if sys.stdout:
            sys.stdout.flush()


def _carried_out(run: Callable[[argparse.Namespace], int], options: argparse.Namespace) -> int:
    try:
        return run(options)
    except BrokenPipeError:
        raise
    except UsageError as error:
        parser: Parser = options.parser
        parser.error(str(error))
    except OSError as error:
        return _failed(_text_of(error))
    except (CommandError, MemoryError) as error:
        return _failed(str(error) or "out of memory")
    except ModuleNotFoundError as error:
        return _failed(f"{error}; '{PROGRAM} doctor' tells what is missing")
    except Exception as error:
        from grid_map_core_py.errors import GridMapError

        if not isinstance(error, GridMapError):
            raise
        return _failed(str(error))


def _text_of(error: OSError) -> str:
    """Return what an error is about and what it says, without its number."""
    return ": ".join(str(part) for part in (error.filename, error.strerror or error) if part)


def _failed(text: str) -> int:
    message(f"error: {' '.join(text.split())}")
    return 1


def _complete(parser: argparse.ArgumentParser) -> None:
    """Answer a shell that asks how a command line may go on; does not return then."""
    if "_ARGCOMPLETE" not in os.environ:
        return
    argcomplete: Any = import_module("argcomplete")
    argcomplete.autocomplete(parser)
