# SPDX-License-Identifier: BSD-3-Clause
"""Comparison of benchmarks with an earlier run."""

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def bench(*options: object) -> subprocess.CompletedProcess[str]:
    only = ["-k", "light_intensity and 200", "-p", "no:cacheprovider"]
    command = [sys.executable, "-m", "pytest", "benchmarks", "--benchmark-only", *only]
    return subprocess.run([*command, *map(str, options)], cwd=ROOT, capture_output=True, text=True)


def test_rows_slower_than_kept_ones_fail(tmp_path):
    file = tmp_path / "yardsticks.json"
    file.write_text('{"other": 1.0}')
    bench("--keep-in", file)
    kept = json.loads(file.read_text())
    assert kept.keys() == {"other", "LightIntensity, 200"}
    for factor, code in ((100, 0), (0.01, 1)):
        earlier = factor * kept["LightIntensity, 200"]
        file.write_text(json.dumps({"LightIntensity, 200": earlier}))
        run = bench("--compare-with", file)
        assert run.returncode == code, run.stdout
        assert (f"LightIntensity, 200: {earlier:.4g} -> " in run.stdout) == (code == 1)
