"""The separate Python environment in which other simulators run."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["OUT", "AbsentError", "run", "sine_platoon"]

OUT = Path("out/bench")
_PACKAGES = ("eclipse-sumo", "libsumo", "jitcdde", "numpy", "setuptools")


class AbsentError(Exception):
    """A referee that cannot be had here, and why."""


def _python() -> Path:
    """The environment's Python; made at the first call."""
    folder = OUT / "env"
    python, done = folder / "bin" / "python", folder / "complete"
    if not done.exists():
        print(f"installing {', '.join(_PACKAGES)} into {folder} …", flush=True)
        try:
            subprocess.run([sys.executable, "-m", "venv", folder], check=True, capture_output=True, text=True)
            install = [python, "-m", "pip", "install", "-q", *_PACKAGES]
            subprocess.run(install, check=True, capture_output=True, text=True)
        except subprocess.CalledProcessError as error:
            reason = (error.stderr or error.stdout or "no reason given").strip().splitlines()[-1]
            raise AbsentError(f"its environment cannot be made ({reason})") from None
        done.touch()
    return python.absolute()


def run(script: str, setup: dict[str, Any]) -> dict[str, Any]:
    """What `referees/<script>.py` makes of `setup`."""
    python = _python()
    with tempfile.TemporaryDirectory() as folder:
        question, answer = Path(folder) / "setup.json", Path(folder) / "result.npz"
        question.write_text(json.dumps(setup))
        path = Path(__file__).parent / "referees" / f"{script}.py"
        done = subprocess.run([python, path.absolute(), question, answer], cwd=folder, capture_output=True, text=True)
        if done.returncode:
            lines = done.stderr.strip().splitlines()
            raise AbsentError(f"it failed ({lines[-1] if lines else f'exit code {done.returncode}'})")
        with np.load(answer) as found:
            return {name: found[name] for name in found.files}


def sine_platoon(followers: int = 5) -> dict[str, Any]:
    """The platoon that all referees are asked about: IDM behind 23 + 2 sin 0.63 t, in equilibrium at the start."""
    idm = {"a": 1.0, "b": 1.5, "T": 1.5, "s0": 2.0, "v0": 33.3}
    gap = (idm["s0"] + 23.0 * idm["T"]) / (1.0 - (23.0 / idm["v0"]) ** 4) ** 0.5
    return {"leader": [23.0, 2.0, 0.63], "followers": followers, "idm": idm, "gap": gap, "length": 5.0}
