# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Run the blocks of a page one after the other, in the working folder.

    python3 run_page.py NAME BLOCKS

BLOCKS is a JSON file: a list of [language, line, text, stop]. All Python shares one namespace;
NAME is that of the page, for its tracebacks. Bash that has a `stop` runs until it has printed that,
and is then interrupted. Prints a JSON list of what the blocks have printed, each.
"""

import contextlib
import io
import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any


def run_python(name: str, line: int, text: str, namespace: dict[str, Any]) -> str:
    # Empty lines before the block, so that tracebacks show line numbers of the page.
    code = compile("\n" * line + text, name, "exec")
    with contextlib.redirect_stdout(io.StringIO()) as output:
        exec(code, namespace)  # noqa: S102
    return output.getvalue()


def run_bash(text: str) -> str:
    return subprocess.run(
        ["bash", "-ec", text], stdout=subprocess.PIPE, text=True, check=True
    ).stdout


def run_until(text: str, stop: str) -> str:
    with subprocess.Popen(
        ["bash", "-ec", f"exec {text}"], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        said = next((line for line in process.stdout if stop in line), None)
        process.send_signal(signal.SIGINT)
        rest = process.stdout.read()
    assert said is not None, f"`{text}` never printed {stop!r}"
    assert process.returncode == 0, f"`{text}` ended with exit code {process.returncode}: {rest}"
    return ""


def main(name: str, blocks: Path) -> None:
    namespace: dict[str, Any] = {"__name__": "page"}
    outputs = []
    for language, line, text, stop in json.loads(blocks.read_text()):
        if stop:
            outputs.append(run_until(text, stop))
        elif language == "bash":
            outputs.append(run_bash(text))
        else:
            outputs.append(run_python(name, line, text, namespace))
    print(json.dumps(outputs))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
