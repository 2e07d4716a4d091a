"""The C loop of `plain.c`: compiling and calling it."""

from __future__ import annotations

import ctypes
import functools
import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from headway.engine.plan import Plan

__all__ = ["FLAGS", "Loop", "compiled", "compiler"]

Array = NDArray[np.float64]

_STRICT = "-O3 -march=native -fno-math-errno -ffp-contract=off"

#: sets of compiler flags by name. The ratios use "strict", which rounds as headway does.
FLAGS = {
    "strict": _STRICT,
    "wide": f"{_STRICT} -mprefer-vector-width=512",
    "fused": "-O3 -march=native -fno-math-errno -ffp-contract=fast -mprefer-vector-width=512",
    "fast": "-Ofast -march=native -mprefer-vector-width=512 -DLIBM=1",
}

_POINTER = ctypes.POINTER(ctypes.c_double)


def compiler() -> str | None:
    """The C compiler, if there is one."""
    return shutil.which(os.environ.get("CC", "cc"))


@functools.cache
def compiled(law: str, equal: bool, prepared: bool, flags: str) -> ctypes.CDLL:
    """The shared library of one law."""
    found = compiler()
    if found is None:
        raise FileNotFoundError("there is no C compiler (cc, or $CC)")
    target = Path(tempfile.mkdtemp(prefix="plain-")) / "plain.so"
    defined = [f"-DLAW={law.upper()}", f"-DEQUAL={int(equal)}", f"-DPREPARED={int(prepared)}"]
    source = str(Path(__file__).with_name("plain.c"))
    options = [*FLAGS[flags].split(), "-shared", "-fPIC", *defined]
    subprocess.run([found, *options, source, "-o", target, "-lm"], check=True)
    library = ctypes.CDLL(str(target))
    shutil.rmtree(target.parent)
    return library


def _pointer(array: Array) -> ctypes._Pointer[ctypes.c_double]:
    return array.ctypes.data_as(_POINTER)


class Loop:
    """The C loop for the same platoons as `plan`: one law, a delay of whole steps, one leader for all lanes."""

    def __init__(self, plan: Plan, late: int, every: int, prepared: bool, flags: str, peak: bool = False) -> None:
        scenario = plan.scenario
        law = scenario.followers[0].model.law.name
        rows, self.lanes = plan.x.shape
        self.steps = plan.mesh.steps
        self.h = float(plan.mesh.time[-1]) / self.steps
        assert np.allclose(np.diff(plan.mesh.time), self.h, rtol=1e-9), "the C loop has equal steps only"
        parameters = plan.platoon.parameters
        equal = bool(np.all(parameters == parameters[:, :1]))
        # room for what is prepared behind the parameters proper
        self.parameters = np.concatenate((parameters, np.zeros((1, parameters.shape[1]))))
        half = np.arange(-2 * late, 2 * self.steps + 1) * (0.5 * self.h)
        self.lead = np.stack(plan.motions[0].at(half, "right"), axis=1).copy()
        self.plan, self.late, self.every, self.rows = plan, late, every, rows
        self.ballistic = scenario.scheme == "ballistic"
        if self.ballistic:
            # positions by the trapezoid rule between nodes, as headway's scheme has them
            x, v = self.lead[::2, 0], self.lead[::2, 1]
            x[late + 1 :] = np.cumsum(0.5 * self.h * (v[late + 1 :] + v[late:-1]))
        self.out = np.zeros((self.steps // every + 1, 3, rows, self.lanes))
        self.peak = np.zeros((rows - 1, self.lanes)) if peak else None
        self.integrate = compiled(law, equal, prepared, flags).integrate

    def __call__(self) -> float:
        """Run it; seconds."""
        p = self.plan
        begin = time.perf_counter()
        self.integrate(
            int(self.ballistic), ctypes.c_long(self.rows - 1), ctypes.c_long(self.lanes), ctypes.c_long(self.steps),
            ctypes.c_double(self.h), ctypes.c_long(self.late), _pointer(self.lead), _pointer(p.platoon.length),
            _pointer(self.parameters), ctypes.c_long(self.parameters.shape[0]), _pointer(p.x), _pointer(p.v),
            ctypes.c_double(float(p.cruise[0])), ctypes.c_long(self.every), _pointer(self.out),
            None if self.peak is None else _pointer(self.peak),
        )  # fmt: skip
        return time.perf_counter() - begin
