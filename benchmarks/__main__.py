"""`python -m benchmarks [PART ...]`: all `PARTS`, or those named."""

from __future__ import annotations

import sys
import traceback
from importlib import import_module

PARTS = ("startup", "study", "eventful", "stability", "calibration", "explorer", "sumo", "jitcdde_check", "kernel")


def main() -> int:
    """Run the parts one after another; a part that fails does not stop the others."""
    chosen = sys.argv[1:] or PARTS
    unknown = [name for name in chosen if name not in PARTS]
    if unknown:
        print(f"there is no part {unknown[0]!r}; parts are {', '.join(PARTS)}", file=sys.stderr)
        return 2
    worst = 0
    for name in chosen:
        print(f"\n== {name}", flush=True)
        try:
            worst = max(worst, import_module(f"benchmarks.{name}").main())
        except Exception:
            traceback.print_exc()
            worst = 1
    return worst


if __name__ == "__main__":
    sys.exit(main())
