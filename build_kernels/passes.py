"""How numba translates a kernel: by the passes that it needs, with what was found before remembered.

Kernels are functions of numbers, tuples and arrays, and the arrays belong to whoever calls them. Numba also looks for
closures, lists and literals that unroll loops, clears what is not used any more, and finds the types and the
implementation of an operator by trying all there are, each time it meets one. Without these, translating takes about
three fifths of the time.
"""

from __future__ import annotations

import contextlib
import operator
from collections.abc import Iterator
from typing import Any
from unittest import mock

from llvmlite import ir
from numba.core import types
from numba.core.base import BaseContext
from numba.core.compiler import CompilerBase
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.lowering import Lower
from numba.core.typed_passes import (
    BaseNativeLowering,
    NoPythonBackend,
    NopythonTypeInference,
    PreLowerStripPhis,
)
from numba.core.types.functions import BaseFunction
from numba.core.untyped_passes import FixupArgs, GenericRewrites, IRProcessing, ReconstructSSA, TranslateByteCode
from numba.np.arrayobj import load_item, store_item

nb: Any = types  # numba has no types of its own


class _Lower(Lower):  # type: ignore[misc]  # numba has no types
    """Numba's, but for elements of arrays: they are found without a copy of what describes the array."""

    def lower_getitem(self, resty: Any, expr: Any, value: Any, index: Any, signature: Any) -> Any:
        """What `value[index]` is."""
        place = self._place(value, index)
        if place is None:
            return super().lower_getitem(resty, expr, value, index, signature)
        found = load_item(self.context, self.builder, self.typeof(value.name), place)
        return self.context.cast(self.builder, found, signature.return_type, resty)

    def lower_setitem(self, target_var: Any, index_var: Any, value_var: Any, signature: Any) -> Any:
        """Do `target_var[index_var] = value_var`."""
        place = self._place(target_var, index_var)
        if place is None:
            return super().lower_setitem(target_var, index_var, value_var, signature)
        array, name = self.typeof(target_var.name), value_var.name
        value = self.context.cast(self.builder, self.loadvar(name), self.typeof(name), array.dtype)
        return store_item(self.context, self.builder, array, value, place)

    def _place(self, array_var: Any, index_var: Any) -> Any:
        """The address of an element of a C-contiguous array; None where something else is asked for."""
        array, index = self.typeof(array_var.name), nb.unliteral(self.typeof(index_var.name))
        kinds = tuple(index) if isinstance(index, nb.BaseTuple) else (index,)
        if not isinstance(array, nb.Array) or array.layout != "C" or len(kinds) != array.ndim:
            return None
        if any(nb.unliteral(kind) != nb.intp for kind in kinds):
            return None
        builder, description, value = self.builder, self.loadvar(array_var.name), self.loadvar(index_var.name)
        model, before = self.context.data_model_manager[array], ir.Constant(ir.IntType(nb.intp.bitwidth), 0)
        for axis in range(array.ndim):
            length = builder.extract_value(description, [model.get_field_position("shape"), axis])
            i = value if kinds == (index,) else builder.extract_value(value, axis)
            i = builder.select(builder.icmp_signed("<", i, ir.Constant(i.type, 0)), builder.add(i, length), i)
            before = builder.add(builder.mul(before, length), i)
        return builder.gep(builder.extract_value(description, model.get_field_position("data")), [before])


@register_pass(mutates_CFG=True, analysis_only=False)
class _Lowering(BaseNativeLowering):  # type: ignore[misc]  # numba has no types
    """To LLVM's language."""

    _name = "lowering_of_kernels"

    @property
    def lowering_class(self) -> type[_Lower]:
        """What does it."""
        return _Lower


class Passes(CompilerBase):  # type: ignore[misc]  # numba has no types
    """The passes that kernels need, in numba's order."""

    def define_pipelines(self) -> list[PassManager]:
        """Numba's question for them."""
        passes = PassManager("kernels")
        untyped = (TranslateByteCode, FixupArgs, IRProcessing, GenericRewrites, ReconstructSSA)
        for each in (*untyped, NopythonTypeInference, PreLowerStripPhis, _Lowering, NoPythonBackend):
            passes.add_pass(each, each.name())
        passes.finalize()
        return [passes]


@contextlib.contextmanager
def remembering() -> Iterator[None]:
    """Meanwhile numba remembers the types of operators, and what has no implementation; and warns of nothing."""
    find_type, find_implementation = BaseFunction.get_call_type, BaseContext.get_function
    operators = set(filter(callable, vars(operator).values()))
    types: dict[Any, Any] = {}
    missing: set[Any] = set()

    def call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        if kws or self.typing_key not in operators:
            return find_type(self, context, args, kws)
        if (self, *args) not in types:
            types[self, *args] = find_type(self, context, args, kws)
        return types[self, *args]

    def implementation(self: Any, fn: Any, sig: Any, _firstcall: bool = True) -> Any:
        if (fn, sig) in missing:
            raise NotImplementedError(f"{fn}{sig}")
        try:
            return find_implementation(self, fn, sig, _firstcall)
        except NotImplementedError:
            missing.add((fn, sig))
            raise

    def catch_no_warnings(self: Any, filename: Any = None, lineno: Any = None) -> Any:
        return nothing

    nothing = contextlib.nullcontext()
    with (
        mock.patch.object(BaseFunction, "get_call_type", call_type),
        mock.patch.object(BaseContext, "get_function", implementation),
        mock.patch("numba.core.errors.WarningsFixer.catch_warnings", catch_no_warnings),
    ):
        yield
