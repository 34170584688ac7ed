# SPDX-License-Identifier: BSD-3-Clause
"""Count the test results and list failures.

The exit code is 1 if a test failed, or if a Python package or the workspace reports no tests.
"""

import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parent.parent


def cases(path: Path) -> Iterator[tuple[str, str]]:
    """Yield the outcome and the name of every test in a JUnit file."""
    for case in ElementTree.parse(path).iter("testcase"):
        yield outcome(case), f"{path.parent.name}: {case.get('classname')}.{case.get('name')}"


def outcome(case: ElementTree.Element) -> str:
    tags = {child.tag for child in case}
    if tags & {"failure", "error"}:
        return "failed"
    return "skipped" if "skipped" in tags else "passed"


def main() -> int:
    results = defaultdict[str, list[tuple[str, str]]](list)
    for path in sorted((ROOT / "build").glob("*/pytest*.xml")):
        results[path.parent.name] += cases(path)
    # Every Python package must report tests, and so must the workspace (`test/`).
    suites = ["workspace", *(path.parent.name for path in sorted(ROOT.glob("*/setup.py")))]
    silent = [suite for suite in suites if not results[suite]]
    every = [case for suite in results.values() for case in suite]
    for result, name in every:
        if result != "passed":
            print(f"{result}: {name}")
    for suite in silent:
        print(f"failed: {suite} ran no test")
    totals = Counter(result for result, _ in every)
    failed = totals["failed"] + len(silent)
    print(f"{totals['passed']} passed, {failed} failed, {totals['skipped']} skipped")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
