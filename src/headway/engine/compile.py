"""A law, compiled: from the one Python function to a loop over vehicles and lanes at a known address.

The loop of a law is a C-callable function, so the integration kernel is compiled once for all laws
and each law once for all scenarios. Both are kept on disk. Numba finds a cached function again by
the file that it stands in, so the loop is written as a small module named after the law's
fingerprint: whatever the law refers to may change, and the name changes with it.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.util
import os
import sys
import tempfile
import types
from pathlib import Path
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import types as nt
from numba.core import cgutils
from numba.extending import intrinsic, overload

from headway.errors import HeadwayError
from headway.models import Law, Model, maths
from headway.models.fingerprint import fingerprint

__all__ = ["address", "cache_folder", "call_rate", "evaluate", "pointer"]

_REAL = nt.CPointer(nt.float64)


@overload(maths.where, inline="never")
def _where(condition, a, b):
    return lambda condition, a, b: a if condition else b


@overload(maths.maximum)
def _maximum(a, b):
    # written as a comparison, which becomes one vector instruction and passes a NaN in `a` on
    return lambda a, b: b if a < b else a


@overload(maths.minimum)
def _minimum(a, b):
    return lambda a, b: b if a > b else a


@overload(maths.power)
def _power(x, n):
    scalar = numba.njit(error_model="numpy")(maths.power_scalar)
    return lambda x, n: scalar(x, n)


def _tanh_compiled(x):
    x = 20.0 if x > 20.0 else (-20.0 if x < -20.0 else x)
    y = x * 0.03125
    q = y * y
    t = y * (10395.0 + q * (1260.0 + q * 21.0)) / (10395.0 + q * (4725.0 + q * (210.0 + q)))
    t = 2.0 * t / (1.0 + t * t)
    t = 2.0 * t / (1.0 + t * t)
    t = 2.0 * t / (1.0 + t * t)
    t = 2.0 * t / (1.0 + t * t)
    return 2.0 * t / (1.0 + t * t)


@overload(maths.tanh)
def _tanh(x):
    return _tanh_compiled


@intrinsic
def pointer(typingctx, array, offset):
    """Pointer to element `offset` of a contiguous float64 array."""

    def codegen(context, builder, signature, args):
        view = context.make_array(signature.args[0])(context, builder, args[0])
        return builder.gep(view.data, [args[1]])

    return _REAL(array, nt.intp), codegen


@intrinsic
def call_rate(typingctx, address, signals, parameters, out, count, signal_stride, parameter_stride, back):
    """Call the loop of a law at `address`."""
    signature = nt.void(nt.intp, _REAL, _REAL, _REAL, nt.intp, nt.intp, nt.intp, nt.intp)

    def codegen(context, builder, signature, args):
        real, whole = ir.DoubleType().as_pointer(), cgutils.intp_t
        function = ir.FunctionType(ir.VoidType(), [real, real, real, whole, whole, whole, whole])
        builder.call(builder.inttoptr(args[0], function.as_pointer()), args[1:])
        return context.get_dummy_value()

    return signature, codegen


@numba.njit(error_model="numpy")
def _call(address, signals, parameters, out):
    n = out.size
    call_rate(address, pointer(signals, 0), pointer(parameters, 0), pointer(out, 0), n, n, 1, 0)


def evaluate(model: Model, signals: np.ndarray) -> np.ndarray:
    """Accelerations (n,) of the compiled law for `signals` (signals of the law, n), as the kernel computes them."""
    out = np.empty(signals.shape[1])
    parameters = np.array(list(model.parameters.values()) or [0.0])[:, None]
    _call(address(model.law, (), False, False), np.ascontiguousarray(signals, dtype=float), parameters, out)
    return out


def cache_folder() -> Path:
    """Where compiled loops are kept: `HEADWAY_CACHE_DIR`, else the user's cache folder, else a temporary one."""
    base = os.environ.get("HEADWAY_CACHE_DIR") or os.path.join(
        os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache"), "headway"
    )
    folder = Path(base) / f"laws-{sys.implementation.cache_tag}-numba{numba.__version__}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return folder
    except OSError:
        pass
    return Path(tempfile.mkdtemp(prefix="headway-"))


@functools.lru_cache(maxsize=None)
def address(law: Law, varying: tuple[str, ...], implicit: bool, chained: bool) -> int:
    """Address of the compiled loop of `law`.

    The loop is `rate(signals, parameters, out, count, signal_stride, parameter_stride, back)`:
    `signals` and `parameters` are rows of elements, in the order of the signature. Parameters not
    in `varying` are the same for all elements and are read once. `implicit`: own acceleration is
    not a signal but what the loop returns; the law is affine in it and is solved exactly.
    `chained`: the acceleration of the vehicle ahead is the result `back` elements earlier; `out`
    then begins with the row of the vehicle ahead of the first.
    """
    try:
        return _compiled(law, varying, implicit, chained).address
    except numba.core.errors.NumbaError as error:
        if os.environ.get("HEADWAY_DEBUG"):
            raise
        reason = str(error).strip().splitlines()
        line = next((r.strip() for r in reason if r.strip() and "Failed in" not in r), "unknown reason")
        raise HeadwayError(
            f"law {law.name} cannot be compiled ({line}); a law may use arithmetic, min, max, abs, if, "
            "NumPy's scalar functions and headway.maths"
        ) from None


def _compiled(law: Law, varying: tuple[str, ...], implicit: bool, chained: bool) -> Any:
    text = _source(law, varying, implicit, chained)
    # cached code looks its module up by name, so a law that moved to another module is another law
    identity = hashlib.sha256(f"{law.function.__module__} {fingerprint(law.function)}".encode()).hexdigest()[:24]
    variant = f"{'i' if implicit else 'e'}{'c' if chained else 's'}_" + "".join(
        "1" if p in varying else "0" for p in law.parameters
    )
    name = f"law_{identity}_{variant}"
    path = cache_folder() / f"{name}.py"
    if not path.exists():
        # another process may write the same file at the same time: both write the same content
        temporary = path.with_suffix(f".{os.getpid()}.tmp")
        temporary.write_text(text)
        os.replace(temporary, path)
    module_spec = importlib.util.spec_from_loader(name, loader=None, origin=str(path))
    assert module_spec is not None
    module = importlib.util.module_from_spec(module_spec)
    module.__file__ = str(path)
    sys.modules[name] = module  # numba looks a cached function's module up by name
    module.__dict__["law"] = numba.njit(error_model="numpy")(_positional(law.function))
    exec(compile(text, str(path), "exec"), module.__dict__)  # the text is ours; the law is a function already
    signature = nt.void(_REAL, _REAL, _REAL, nt.intp, nt.intp, nt.intp, nt.intp)
    decorate = numba.cfunc(signature, cache=True, error_model="numpy")
    try:
        return decorate(module.__dict__["rate"])
    except (ImportError, AttributeError):
        # it was compiled by a version of this package whose modules had other names: compile it anew
        for stale in path.parent.glob(f"__pycache__/{name}.*.nb?"):
            stale.unlink(missing_ok=True)
        return decorate(module.__dict__["rate"])


def _positional(function: Any) -> types.FunctionType:
    """The function with its keyword-only arguments made positional: numba refuses the former."""
    plain = getattr(function, "__wrapped__", function)
    if not isinstance(plain, types.FunctionType):
        raise HeadwayError(f"law {function!r} is not a plain Python function")
    code = plain.__code__
    code = code.replace(co_argcount=code.co_argcount + code.co_kwonlyargcount, co_kwonlyargcount=0)
    return types.FunctionType(code, plain.__globals__, plain.__name__, None, plain.__closure__)


def _source(law: Law, varying: tuple[str, ...], implicit: bool, chained: bool) -> str:
    """The loop as text."""
    names = list(law.parameters)
    lines = [
        f'"""Loop of the law {law.name}, written by headway; may be deleted at any time."""',
        "from numba import carray",
        "",
        "def rate(signals, parameters, out, count, signal_stride, parameter_stride, back):",
        f"    S = carray(signals, ({len(law.signals)}, signal_stride))",
        f"    P = carray(parameters, ({max(len(names), 1)}, parameter_stride))",
        f"    O = carray(out, (count{' + back' if chained else ''},))",
    ]
    lines += [f"    p_{n} = P[{i}, 0]" for i, n in enumerate(names) if n not in varying]
    lines.append("    for i in range(count):")
    lines += [f"        p_{n} = P[{i}, i]" for i, n in enumerate(names) if n in varying]

    def call(own: str) -> str:
        arguments = []
        for i, signal in enumerate(law.signals):
            if signal == "a" and implicit:
                arguments.append(own)
            elif signal == "al" and chained:
                arguments.append("O[i]")
            else:
                arguments.append(f"S[{i}, i]")
        return f"law({', '.join(arguments + [f'p_{n}' for n in names])})"

    own = "O[i + back]" if chained else "O[i]"
    if implicit:
        lines += [f"        still = {call('0.0')}", f"        {own} = still / (1.0 - ({call('1.0')} - still))"]
    else:
        lines.append(f"        {own} = {call('')}")
    return "\n".join(lines) + "\n"
