# SPDX-License-Identifier: BSD-3-Clause
"""Small workspaces for tests of the tools, and the environment of a shell without ROS."""

import hashlib
import os
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Mapping
from importlib.metadata import distribution
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = sorted(path.parent for path in ROOT.glob("*/package.xml"))
PYTHON_PACKAGES = sorted(path.parent for path in ROOT.glob("*/setup.py"))

BASE_PYTHON = Path(sys.base_prefix) / "bin" / f"python3.{sys.version_info.minor}"


def executables(package: str) -> dict[str, str]:
    """Return the module of each executable of a package."""
    entries = distribution(package).entry_points.select(group="console_scripts")
    return {entry.name: entry.module for entry in entries}


SHELL_PROGRAMS = ("cat", "dirname", "env", "grep", "paste", "sed", "sh", "tr", "uname")


def fresh_environment(**changes: str) -> dict[str, str]:
    """Return the environment of a login without ROS and without our tools."""
    path = ":".join(p for p in os.environ["PATH"].split(":") if not p.startswith(f"{ROOT}/"))
    return {"HOME": os.environ.get("HOME", "/"), "PATH": path, **changes}


def copy_tools(folder: Path) -> Path:
    """Make `folder` a workspace without packages."""
    shutil.copytree(ROOT / "tools", folder / "tools", ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def offer_wheel(folder: Path, name: str, version: str) -> str:
    """Put an empty wheel into `folder`, so that pip needs no network; return its requirement."""
    folder.mkdir(exist_ok=True)
    info = f"{name}-{version}.dist-info"
    files = {
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    record = "".join(f"{path},,\n" for path in [*files, f"{info}/RECORD"])
    file = folder / f"{name}-{version}-py3-none-any.whl"
    with zipfile.ZipFile(file, "w") as wheel:
        for path, text in {**files, f"{info}/RECORD": record}.items():
            wheel.writestr(path, text)
    return f"{name}=={version} --hash=sha256:{hashlib.sha256(file.read_bytes()).hexdigest()}\n"


def run(
    *command: str | Path, environ: Mapping[str, str], cwd: Path = ROOT
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(word) for word in command],
        env=dict(environ),
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
