# SPDX-License-Identifier: BSD-3-Clause
"""Show versions, missing or broken packages, and the settings of ROS and DDS."""

import argparse
import json
import os
import platform
import subprocess
import sys

from .._packages import PACKAGES, remedy_for
from ._arguments import add_json
from ._output import print_json, print_table

REQUIRED = ("numpy", "scipy", "cv2", "yaml", "grid_map_core_py")

_PROBE = """
import sys

# Files of the current folder are no modules. Before Python 3.11, there is no option -P.
sys.path[:1] == [""] and sys.path.pop(0)

import importlib, importlib.metadata, json, os

answers = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)
owners = importlib.metadata.packages_distributions()
for module in sys.argv[1:]:
    status, text = "ok", ""
    top = module.partition(".")[0]
    try:
        loaded = importlib.import_module(module)
        text = str(getattr(loaded, "__version__", ""))
        text = text or importlib.metadata.version(owners.get(top, [top])[0])
    except importlib.metadata.PackageNotFoundError:
        pass
    except BaseException as error:
        is_missing = isinstance(error, ImportError) and module.startswith(error.name or module)
        status, text = ("missing", "") if is_missing else ("broken", " ".join(str(error).split()))
    print(json.dumps([status, text]), file=answers, flush=True)
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    packages = examined([*PACKAGES])
    failures = [
        name
        for name, (status, _) in packages.items()
        if status == "broken" or (status == "missing" and name in REQUIRED)
    ]
    beginnings = ("ROS_", "RMW_", "FASTRTPS_", "FASTDDS_", "CYCLONEDDS_", "AMENT_PREFIX_PATH")
    settings = sorted(pair for pair in os.environ.items() if pair[0].startswith(beginnings))
    version = platform.python_version()
    if options.json:
        print_json(
            {
                "ok": not failures,
                "python": {"version": version, "executable": sys.executable},
                "packages": {
                    name: {
                        "status": status,
                        "text": text,
                        "gives": PACKAGES[name].gives,
                        "remedy": remedy_for(name),
                    }
                    for name, (status, text) in packages.items()
                },
                "settings": dict(settings),
            }
        )
        return bool(failures)
    print(f"Python {version} at {sys.executable}")
    rows = []
    for name, (status, text) in packages.items():
        advice = f"{PACKAGES[name].gives} ({remedy_for(name)}){': ' if text else ''}{text}"
        rows.append((status, name, text if status == "ok" else advice))
    print_table(rows)
    print_table([("", *pair) for pair in settings] or [("no ROS settings",)])
    print(f"To repair: {', '.join(failures)}" if failures else "All that is installed works.")
    return bool(failures)


def examined(modules: list[str]) -> dict[str, tuple[str, str]]:
    """Return the status ("ok", "missing" or "broken") and the version or error of each module."""
    found: dict[str, tuple[str, str]] = {}
    while rest := modules[len(found) :]:
        # A separate process imports the modules, because a broken module may end Python.
        command = [sys.executable, "-c", _PROBE, *rest]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        answers = [json.loads(line) for line in done.stdout.splitlines()]
        found |= {name: (*answer,) for name, answer in zip(rest, answers, strict=False)}
        if len(answers) < len(rest):
            died = f"importing it ends Python with exit code {done.returncode}"
            found[rest[len(answers)]] = ("broken", died)
    return found
