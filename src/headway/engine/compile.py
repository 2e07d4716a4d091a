"""A law, compiled: from the one Python function to a loop over vehicles and lanes at a known address.

The loop of a law is a C-callable function, so the integration kernel is compiled once for all laws
and each law once for all scenarios. Both are kept on disk. Numba finds a cached function again by
the file that it stands in, so the loop is written as a small module named after the law's
fingerprint: whatever the law refers to may change, and the name changes with it.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib.util
import os
import sys
import types
from pathlib import Path
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import types as nt
from numba.core import cgutils
from numba.extending import intrinsic, overload

from headway.environment import compile_without_disk
from headway.errors import HeadwayError
from headway.models import Law, Model, maths
from headway.models.fingerprint import fingerprint
from headway.models.signal import SIGNALS
from headway.version import __version__

__all__ = ["address", "address_of", "at", "cache_folder", "call_rate", "evaluate", "whole"]

compile_without_disk()


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


@overload(maths.tanh, jit_options={"forceinline": True})
def _tanh(x):
    within = numba.njit(error_model="numpy", forceinline=True)(maths.tanh_within)
    # cut off by comparisons, which become vector instructions
    return lambda x: within(20.0 if x > 20.0 else (-20.0 if x < -20.0 else x))


@intrinsic
def address_of(typingctx, array, offset):
    """Address of element `offset` of a contiguous array."""

    def codegen(context, builder, signature, args):
        view = context.make_array(signature.args[0])(context, builder, args[0])
        return builder.ptrtoint(builder.gep(view.data, [args[1]]), cgutils.intp_t)

    return nt.intp(array, nt.intp), codegen


@intrinsic
def at(typingctx, address):
    """Pointer to the float64 at an address."""

    def codegen(context, builder, signature, args):
        return builder.inttoptr(args[0], ir.DoubleType().as_pointer())

    return nt.CPointer(nt.float64)(nt.intp), codegen


@intrinsic
def whole(typingctx, address):
    """Pointer to the int64 at an address."""

    def codegen(context, builder, signature, args):
        return builder.inttoptr(args[0], ir.IntType(64).as_pointer())

    return nt.CPointer(nt.int64)(nt.intp), codegen


@intrinsic
def call_rate(typingctx, address, sources, parameters, out, count, first, stride, back):
    """Call the loop of a law at `address`, see `address`."""

    def codegen(context, builder, signature, args):
        function = ir.FunctionType(ir.VoidType(), [cgutils.intp_t] * 7)
        builder.call(builder.inttoptr(args[0], function.as_pointer()), args[1:])
        return context.get_dummy_value()

    return nt.void(*[nt.intp] * 8), codegen


@numba.njit(error_model="numpy")
def _call(address, sources, parameters, out):
    call_rate(address, address_of(sources, 0), address_of(parameters, 0), address_of(out, 0), out.size, 0, 1, 0)


def evaluate(model: Model, signals: np.ndarray) -> np.ndarray:
    """Accelerations (n,) of the compiled law for `signals` (signals of the law, n), as the kernel computes them."""
    out = np.empty(signals.shape[1])
    rows = np.ascontiguousarray(signals, dtype=float)
    nothing = np.zeros(signals.shape[1])
    # a gap is a difference of positions less a length, a relative speed a difference
    sources = np.full((len(rows), 3), nothing.ctypes.data)
    sources[:, 0] = [row.ctypes.data for row in rows]
    parameters = np.array(list(model.parameters.values()) or [0.0])[:, None]
    _call(address(model.law, structural(model), (), False, False), sources, parameters, out)
    return out


def structural(model: Model) -> tuple[tuple[str, float], ...]:
    """The parameters that select a form of the law, with their values."""
    return tuple((n, x) for n, x in model.items if model.law.parameters[n].info.structural)


def cache_folder() -> Path | None:
    """The folder that compiled loops are kept in: `HEADWAY_CACHE_DIR`, else `headway` in the user's cache folder.

    Returns:
        The folder, or None if it cannot be made or written to.
    """
    base = os.environ.get("HEADWAY_CACHE_DIR") or os.path.join(
        os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache"), "headway"
    )
    folder = Path(base) / f"laws-{sys.implementation.cache_tag}-numba{numba.__version__}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    return folder if os.access(folder, os.W_OK) else None


def _cache_file(name: str, text: str) -> Path | None:
    """The file of a loop, which is written if it is not there; None where it cannot be."""
    folder = cache_folder()
    if folder is None:
        return None
    path = folder / f"{name}.py"
    if path.exists():
        return path
    # another process may write the same file at the same time: both write the same content
    temporary = path.with_suffix(f".{os.getpid()}.tmp")
    try:
        temporary.write_text(text)
        os.replace(temporary, path)
    except OSError:
        with contextlib.suppress(OSError):
            temporary.unlink()
        return None
    return path


@functools.cache
def address(
    law: Law, fixed: tuple[tuple[str, float], ...], varying: tuple[str, ...], implicit: bool, chained: bool
) -> int:
    """Address of the compiled loop of `law`.

    The loop is `rate(sources, parameters, out, count, first, stride, back)`, all addresses and whole
    numbers. `sources` are three addresses for each signal: what it is made of (for `s` the position
    ahead, one's own, and the length to be left out; for `dv` the speed ahead and one's own), from
    element `first` on. `parameters` are rows of `stride` elements. `fixed` parameters are constants
    of the loop; of the others those not in `varying` are the same for all elements and are read once.
    `implicit`: own acceleration is not a signal but what the loop returns; the law is affine in it
    and is solved exactly. `chained`: the acceleration of the vehicle ahead is the result `back`
    elements earlier; `out` then begins with the row of the vehicle ahead of the first.
    """
    try:
        return _compiled(law, fixed, varying, implicit, chained).address
    except (numba.core.errors.NumbaError, TypeError, ValueError, NotImplementedError, RecursionError) as error:
        reason = str(error).strip().splitlines()
        line = next((r.strip() for r in reason if r.strip() and "Failed in" not in r), "unknown reason")
        raise HeadwayError(
            f"law {law.name} cannot be compiled ({line}); a law may use arithmetic, min, max, abs, if, "
            "NumPy's scalar functions and headway.maths"
        ) from None


def _compiled(
    law: Law, fixed: tuple[tuple[str, float], ...], varying: tuple[str, ...], implicit: bool, chained: bool
) -> Any:
    text = _source(law, dict(fixed), varying, implicit, chained)
    # cached code looks its module up by name, so a law that moved to another module is another law
    identity = "\n".join((__version__, law.function.__module__, fingerprint(law.function), text))
    name = f"law_{hashlib.sha256(identity.encode()).hexdigest()[:32]}"
    path = _cache_file(name, text)
    place = str(path or f"<{name}>")
    module_spec = importlib.util.spec_from_loader(name, loader=None, origin=place)
    assert module_spec is not None
    module = importlib.util.module_from_spec(module_spec)
    module.__file__ = place
    sys.modules[name] = module  # numba looks a cached function's module up by name
    module.__dict__["law"] = numba.njit(error_model="numpy", forceinline=True)(_positional(law.function))
    exec(compile(text, place, "exec"), module.__dict__)  # the text is ours; the law is a function already
    signature = nt.void(*[nt.intp] * 7)
    decorate = numba.cfunc(signature, cache=path is not None, error_model="numpy")
    try:
        return decorate(module.__dict__["rate"])
    except (ImportError, AttributeError):
        if path is None:
            raise
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
    return types.FunctionType(code, _with_compiled_helpers(plain), plain.__name__, None, plain.__closure__)


def _with_compiled_helpers(function: types.FunctionType) -> dict[str, Any]:
    """The globals of a function, in which plain functions that it calls by name are compiled too."""
    found = dict(function.__globals__)
    for name in function.__code__.co_names:
        helper = found.get(name)
        if isinstance(helper, types.FunctionType) and not helper.__module__.startswith(("headway.models.", "numpy")):
            inner = types.FunctionType(
                helper.__code__, _with_compiled_helpers(helper), name, helper.__defaults__, helper.__closure__
            )
            found[name] = numba.njit(error_model="numpy", forceinline=True)(inner)
    return found


def _made_of(name: str) -> tuple[int, str]:
    """How many addresses a signal is made of, and how its value is made of them."""
    signal = SIGNALS[name]
    if signal.less is None:
        return 1, "{0}"
    return (3, "{0} - {1} - {2}") if signal.order == 0 else (2, "{0} - {1}")


def _source(law: Law, fixed: dict[str, float], varying: tuple[str, ...], implicit: bool, chained: bool) -> str:
    """The loop as text."""
    names = list(law.parameters)
    lines = [
        f'"""Loop of the law {law.name}, written by headway; may be deleted at any time."""',
        "from numba import carray",
        "from headway.engine.compile import at, whole",
        "",
        "def rate(sources, parameters, out, count, first, stride, back):",
        f"    S = carray(whole(sources), ({3 * len(law.signals)},))",
        f"    P = carray(at(parameters), ({max(len(names), 1)}, stride))",
        f"    O = carray(at(out), (count{' + back' if chained else ''},))",
    ]
    lines += [f"    p_{n} = {float(x)!r}" for n, x in fixed.items()]
    lines += [f"    p_{n} = P[{i}, 0]" for i, n in enumerate(names) if n not in varying and n not in fixed]
    values = {}
    for i, signal in enumerate(law.signals):
        if (signal == "a" and implicit) or (signal == "al" and chained):
            continue
        count, form = _made_of(signal)
        lines += [f"    {signal}_{j} = carray(at(S[{3 * i + j}] + 8 * first), (count,))" for j in range(count)]
        values[signal] = form.format(*(f"{signal}_{j}[i]" for j in range(count)))
    lines.append("    for i in range(count):")
    lines += [f"        p_{n} = P[{i}, i]" for i, n in enumerate(names) if n in varying]
    values |= {"al": "O[i]"} if chained else {}

    def call(own: str) -> str:
        arguments = [values.get(signal, own) for signal in law.signals]
        return f"law({', '.join(arguments + [f'p_{n}' for n in names])})"

    target = "O[i + back]" if chained else "O[i]"
    if implicit:
        lines += [f"        still = {call('0.0')}", f"        {target} = still / (1.0 - ({call('1.0')} - still))"]
    else:
        lines.append(f"        {target} = {call('')}")
    return "\n".join(lines) + "\n"
