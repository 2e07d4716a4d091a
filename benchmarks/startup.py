"""What a person waits for: whole processes from start to end, and the memory of a long run."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from .environment import OUT

_SCENARIO = """duration = 50
[leader]
kind = "sine"
mean = 23
amplitude = 2
omega = 0.63
[[followers]]
model = "idm"
count = 5
delay = 0.15
"""

_LONG = """duration = 600
dt = 0.05
output_step = 0.5
[leader]
kind = "sine"
mean = 23
amplitude = 2
omega = 0.63
[[followers]]
model = "idm"
count = 999
parameters = { T = 1.8, a = 1.5 }
"""


def headway(*arguments: str, caches: Path | None = None) -> float:
    """Seconds of a whole `headway` process; `caches` takes the place of the user's cache folders."""
    folders = {} if caches is None else {"HEADWAY_CACHE_DIR": str(caches), "NUMBA_CACHE_DIR": str(caches)}
    begin = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "headway", *arguments], env=os.environ | folders, capture_output=True, text=True
    )
    taken = time.perf_counter() - begin
    if done.returncode:
        raise RuntimeError(f"headway {' '.join(arguments)} failed: {done.stderr.strip()}")
    return taken


def memory(scenario: Path, result: Path) -> tuple[float, float]:
    """Most memory [MB] and seconds of a run in a process of its own."""
    child = (
        "import resource, subprocess, sys\n"
        "subprocess.run(sys.argv[1:], check=True, capture_output=True)\n"
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)\n"
    )
    command = [sys.executable, "-m", "headway", "run", str(scenario), "--out", str(result)]
    begin = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", child, *command], check=True, capture_output=True, text=True)
    unit = 1 if sys.platform == "darwin" else 1024
    return int(done.stdout) * unit / 1e6, time.perf_counter() - begin


def measure() -> dict[str, float]:
    """All of it: medians [s], and memory [MB]."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scenario, long = folder / "scenario.toml", folder / "long.toml"
        scenario.write_text(_SCENARIO)
        long.write_text(_LONG)
        helps = [headway("--help") for _ in range(9)]
        first = headway("run", str(scenario), caches=folder / "cache")
        warm = [headway("run", str(scenario), caches=folder / "cache") for _ in range(7)]
        headway("run", str(long))
        most, seconds = memory(long, folder / "long.nc")
    return {
        "help [s]": statistics.median(helps),
        "warm run [s]": statistics.median(warm),
        "first run [s]": first,
        "long run [s]": seconds,
        "long run [MB]": most,
    }


#: what each should stay below
ALLOWED = {"help [s]": 0.3, "warm run [s]": 1.5, "first run [s]": 15.0, "long run [MB]": 400.0}


def main() -> int:
    """Print the table and write `out/bench/startup.json`."""
    found = measure()
    for name, number in found.items():
        limit = f"  (at most {ALLOWED[name]:g})" if name in ALLOWED else ""
        print(f"{name:14}{number:8.2f}{limit}")
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / "startup.json").write_text(json.dumps(found, indent=1))
    return 0 if all(found[name] <= limit for name, limit in ALLOWED.items()) else 1


if __name__ == "__main__":
    sys.exit(main())
