"""Calls of compiled code by its address.

What the kernel calls by address is compiled by itself, once, and not put in place again wherever it
is called. Tuples are handed over where they stand: their types follow from `headway.engine.layout`.
"""

from __future__ import annotations

from typing import Any, get_type_hints

from llvmlite import ir
from numba import types as nt
from numba.core import cgutils
from numba.extending import intrinsic

from headway.engine import layout
from headway.environment import compile_without_disk

__all__ = ["LANES", "address_of_tuple", "alone_at", "call_lanes", "platoon_at", "state_at", "steps_at", "type_of"]

compile_without_disk()


def type_of(tuple_class: type) -> nt.NamedTuple:
    """Numba's type of a tuple of the layout."""
    types = []
    for hint in get_type_hints(tuple_class, include_extras=True).values():
        if hint is float:
            types.append(nt.float64)
        elif hint is int:
            types.append(nt.int64)
        elif isinstance(hint, type):
            types.append(type_of(hint))
        else:
            number, axes = hint.__metadata__
            types.append(nt.Array(getattr(nt, number), axes, "C"))
    return nt.NamedTuple(types, tuple_class)


def _reader(tuple_class: type) -> Any:
    """An intrinsic that reads the tuple at an address."""
    kind = type_of(tuple_class)

    @intrinsic
    def read(typingctx, address):
        def codegen(context, builder, signature, args):
            return builder.load(builder.inttoptr(args[0], context.get_value_type(kind).as_pointer()))

        return kind(nt.intp), codegen

    return read


platoon_at = _reader(layout.Platoon)
steps_at = _reader(layout.Steps)
state_at = _reader(layout.State)
alone_at = _reader(layout.Alone)


@intrinsic
def address_of_tuple(typingctx, value):
    """Address of a copy of a tuple, which lasts as long as the function runs that asks for it."""

    def codegen(context, builder, signature, args):
        place = cgutils.alloca_once(builder, context.get_value_type(signature.args[0]))
        builder.store(args[0], place)
        return builder.ptrtoint(place, cgutils.intp_t)

    return nt.intp(value), codegen


#: signature of `headway.engine.lane.step_lanes`
LANES = nt.void(*[nt.intp] * 7)


@intrinsic
def call_lanes(typingctx, address, k, row0, lanes, platoon, steps, state, alone):
    """Call `headway.engine.lane.step_lanes` at `address`; of tuples their addresses are handed over."""

    def codegen(context, builder, signature, args):
        function = ir.FunctionType(ir.VoidType(), [cgutils.intp_t] * 7)
        builder.call(builder.inttoptr(args[0], function.as_pointer()), args[1:])
        return context.get_dummy_value()

    return nt.void(*[nt.intp] * 8), codegen
