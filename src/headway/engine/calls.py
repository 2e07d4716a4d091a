"""Calls of compiled code by its address.

What the kernel calls by address is compiled by itself, once: what compiled functions call by name
is optimised again with each of them, and again with what calls those. Tuples are handed over where
they stand; their types follow from `headway.engine.layout`.
"""

from __future__ import annotations

from typing import Any, get_type_hints

from llvmlite import ir
from numba import types as nt
from numba.core import cgutils
from numba.core.imputils import lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import intrinsic, models, register_model

from headway.engine import layout
from headway.environment import compile_without_disk

__all__ = ["ALONE", "LANES", "PIECE", "PLATOON", "STATE", "STEPS", "at_place", "call_lanes", "call_piece"]

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


class TupleAt(nt.Type):
    """A tuple where it stands in memory: one word, whose fields are read when they are asked for.

    Handed over as it is, a tuple of the layout is some hundred words in every call, and takes most of the time of
    compiling.
    """

    def __init__(self, tuple_class: type) -> None:
        self.tuple_class = tuple_class
        self.kind = type_of(tuple_class)
        super().__init__(name=f"TupleAt({tuple_class.__name__})")

    def field(self, name: str) -> nt.Type | None:
        """Type of a field; a tuple within a tuple is one where it stands, too."""
        if name not in self.kind.fields:
            return None
        kind = self.kind.types[self.kind.fields.index(name)]
        return TupleAt(kind.instance_class) if isinstance(kind, nt.BaseTuple) else kind


@register_model(TupleAt)
class _TupleAtModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: TupleAt) -> None:
        super().__init__(manager, kind, cgutils.intp_t)


@infer_getattr
class _TupleAtFields(AttributeTemplate):
    key = TupleAt

    def generic_resolve(self, value: TupleAt, name: str) -> nt.Type:
        return value.field(name)


@lower_getattr_generic(TupleAt)
def _field(context, builder, kind, value, name):
    """Read a field; arrays stay where they are as long as compiled code runs, so their places are read once."""
    whole = builder.inttoptr(value, context.get_value_type(kind.kind).as_pointer())
    place = cgutils.gep_inbounds(builder, whole, 0, kind.kind.fields.index(name))
    if isinstance(kind.field(name), TupleAt):
        return builder.ptrtoint(place, cgutils.intp_t)
    return _read(builder, place)


def _read(builder, place):
    """Load a number, or an array word by word, so that words that are not needed are not read."""
    kind = place.type.pointee
    if isinstance(kind, (ir.LiteralStructType, ir.ArrayType)):
        value = ir.Constant(kind, ir.Undefined)
        for i in range(len(kind.elements) if isinstance(kind, ir.LiteralStructType) else kind.count):
            value = builder.insert_value(value, _read(builder, cgutils.gep_inbounds(builder, place, 0, i)), i)
        return value
    number = builder.load(place)
    number.set_metadata("invariant.load", builder.module.add_metadata([]))
    return number


PLATOON, STEPS, STATE, ALONE = (TupleAt(c) for c in (layout.Platoon, layout.Steps, layout.State, layout.Alone))


@intrinsic
def at_place(typingctx, value):
    """A tuple where a copy of it stands, which lasts as long as the function runs that asks for it."""

    def codegen(context, builder, signature, args):
        place = cgutils.alloca_once(builder, context.get_value_type(signature.args[0]))
        builder.store(args[0], place)
        return builder.ptrtoint(place, cgutils.intp_t)

    return TupleAt(value.instance_class)(value), codegen


def _call(signature: Any) -> Any:
    """A call of a function of this signature by its address."""

    def codegen(context, builder, _, args):
        words = [context.get_value_type(kind) for kind in signature.args]
        function = ir.FunctionType(ir.VoidType(), words)
        builder.call(builder.inttoptr(args[0], function.as_pointer()), args[1:])
        return context.get_dummy_value()

    return nt.void(nt.intp, *signature.args), codegen


#: signature of `headway.engine.lane._step_lanes`
LANES = nt.void(nt.intp, nt.intp, nt.intp, PLATOON, STEPS, STATE, ALONE)

#: signature of `headway.engine.lane._piece`
PIECE = nt.void(*[nt.intp] * 4, nt.float64, nt.float64, PLATOON, STEPS, STATE, ALONE, nt.intp)


@intrinsic
def call_lanes(typingctx, address, k, row0, lanes, platoon, steps, state, alone):
    """Call `headway.engine.lane._step_lanes` at `address`."""
    return _call(LANES)


@intrinsic
def call_piece(typingctx, address, fresh, lane, k, row0, start, length, platoon, steps, state, alone, lanes):
    """Call `headway.engine.lane._piece` at `address`."""
    return _call(PIECE)
