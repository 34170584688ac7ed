# SPDX-License-Identifier: BSD-3-Clause
"""Compare the benchmark times of a commit and of this checkout, on this machine.

Usage: python3 benchmarks/compare.py COMMIT [FILE ...] [-k EXPRESSION] [--rounds N]

Each benchmark file runs N times alternately with the sources of the commit and of this checkout,
so both run under the same load. The result of a row is the smallest time in yardsticks. The exit
code is 1 if a row became more than 10 % slower.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LIMIT = 1.10
"""Time ratio (after / before) above which a row counts as slower."""

Rows = dict[str, float]
"""Times in yardsticks, by row name."""


def measured(checkout: Path, file: str, words: Iterable[str]) -> Rows:
    """Run one benchmark file with the sources of a checkout."""
    sources = [str(path.parent) for path in sorted(checkout.glob("*/setup.py"))]
    paths = ":".join([*sources, os.environ.get("PYTHONPATH", "")])
    with tempfile.NamedTemporaryFile(suffix=".json") as result:
        command = [
            "pytest",
            f"benchmarks/{file}",
            "--benchmark-only",
            "-q",
            "-p",
            "no:cacheprovider",
        ]
        command += [f"--benchmark-json={result.name}", *words]
        done = subprocess.run(
            [sys.executable, "-m", *command],
            cwd=checkout,
            env={**os.environ, "PYTHONPATH": paths},
            capture_output=True,
            text=True,
        )
        text = result.read()
        if not text and "deselected" in done.stdout:
            return {}
        if done.returncode:
            sys.exit(f"benchmarks/{file} of {checkout} failed:\n{done.stdout}{done.stderr}")
    found = json.loads(text)["benchmarks"]
    return {row["fullname"]: row["extra_info"]["yardsticks"] for row in found}


def compared(before: Path, files: list[str], words: list[str], rounds: int) -> tuple[Rows, Rows]:
    """Return the rows of the checkout `before` and of this checkout."""
    old: Rows = {}
    new: Rows = {}
    for file in files or sorted(path.name for path in (ROOT / "benchmarks").glob("bench_*.py")):
        for _ in range(rounds):
            for checkout, rows in ((before, old), (ROOT, new)):
                if (checkout / "benchmarks" / file).exists():
                    for name, value in measured(checkout, file, words).items():
                        rows[name] = min(value, rows.get(name, value))
    return old, new


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("commit", help="commit, branch or tag to compare with")
    parser.add_argument("files", nargs="*", metavar="FILE", help="files in benchmarks/ (all)")
    parser.add_argument("-k", metavar="EXPRESSION", help="run only matching benchmarks, as pytest")
    parser.add_argument("--rounds", type=int, default=2, help="runs of each side (%(default)s)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        packed = subprocess.run(
            ["git", "-C", ROOT, "archive", options.commit], stdout=subprocess.PIPE, check=False
        )
        if packed.returncode:
            return packed.returncode
        subprocess.run(["tar", "-x", "-C", folder], input=packed.stdout, check=True)
        words = ["-k", options.k] if options.k else []
        old, new = compared(Path(folder), options.files, words, options.rounds)
    ratios = {name: new[name] / old[name] for name in old.keys() & new.keys()}
    for name, ratio in sorted(ratios.items(), key=lambda item: -item[1]):
        print(f"{ratio:6.2f}  {old[name]:10.4f} -> {new[name]:10.4f} yardsticks  {name}")
    slower = sum(ratio > LIMIT for ratio in ratios.values())
    lost, added = len(old.keys() - new.keys()), len(new.keys() - old.keys())
    print(
        f"{len(ratios)} rows: {slower} slower by more than {LIMIT - 1:.0%}, "
        f"{sum(ratio < 1 / LIMIT for ratio in ratios.values())} faster by as much; "
        f"{lost} only in {options.commit}, {added} only here"
    )
    return int(slower > 0 or not ratios)


if __name__ == "__main__":
    sys.exit(main())
