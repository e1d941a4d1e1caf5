"""Operations on single elements: C expressions by the names of JAX's primitives."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp

from s2c2a.errors import S2C2AError
from s2c2a.integrations.c_code.jaxprs import UNCHANGED
from s2c2a.integrations.c_code.values import Kind

EXPENSIVE = 8  # operations that a call of the C library counts as

COMMON_TEMPLATES = {
    "add": "({0} + {1})",
    "add_any": "({0} + {1})",
    "sub": "({0} - {1})",
    "mul": "({0} * {1})",
    "div": "({0} / {1})",
    "neg": "(-{0})",
}
FLOAT_TEMPLATES = COMMON_TEMPLATES | {
    "rem": "fmodf({0}, {1})",
    "max": "s_max({0}, {1})",
    "min": "s_min({0}, {1})",
    "abs": "fabsf({0})",
    "sign": "s_sign({0})",
    "floor": "floorf({0})",
    "ceil": "ceilf({0})",
    "exp": "expf({0})",
    "exp2": "exp2f({0})",
    "expm1": "expm1f({0})",
    "log": "logf({0})",
    "log1p": "log1pf({0})",
    "sqrt": "sqrtf({0})",
    "rsqrt": "(1.0f / sqrtf({0}))",
    "cbrt": "cbrtf({0})",
    "sin": "sinf({0})",
    "cos": "cosf({0})",
    "tan": "tanf({0})",
    "asin": "asinf({0})",
    "acos": "acosf({0})",
    "atan": "atanf({0})",
    "sinh": "sinhf({0})",
    "cosh": "coshf({0})",
    "tanh": "tanhf({0})",
    "asinh": "asinhf({0})",
    "erf": "erff({0})",
    "logistic": "s_logistic({0})",
    "square": "s_square({0})",
    "pow": "powf({0}, {1})",
    "atan2": "atan2f({0}, {1})",
    "is_finite": "(isfinite({0}) ? 1 : 0)",
    "clamp": "s_min(s_max({1}, {0}), {2})",
}
INTEGER_TEMPLATES = COMMON_TEMPLATES | {
    "rem": "({0} % {1})",
    "max": "s_imax({0}, {1})",
    "min": "s_imin({0}, {1})",
    "abs": "abs({0})",
    "sign": "(({0} > 0) - ({0} < 0))",
    "square": "({0} * {0})",
    "and": "({0} & {1})",
    "or": "({0} | {1})",
    "xor": "({0} ^ {1})",
    "clamp": "s_imin(s_imax({1}, {0}), {2})",
}
COMPARISONS = {
    "eq": "==",
    "ne": "!=",
    "lt": "<",
    "le": "<=",
    "gt": ">",
    "ge": ">=",
    "lt_to": "<",
    "le_to": "<=",
}


def element_of(
    name: str, params: dict[str, Any], dtypes: list[Any]
) -> Callable[..., str] | None:
    """The expression of an element from those of the operands; None if unknown.

    Args:
        name: of the primitive.
        params: of the operation.
        dtypes: of the operands.
    """
    is_float = any(jnp.issubdtype(dtype, jnp.floating) for dtype in dtypes)
    if name in UNCHANGED:
        return lambda operand: operand
    if name in COMPARISONS:
        sign = COMPARISONS[name]
        return lambda left, right: f"({left} {sign} {right})"
    if name == "not":
        mark = "!" if dtypes[0] is jnp.dtype(bool) else "~"
        return lambda operand: f"({mark}{operand})"
    if name == "convert_element_type":
        return _conversion(dtypes[0], params["new_dtype"])
    if name == "integer_pow":
        exponent = params["y"]
        if exponent == 2:
            return lambda operand: f"s_square({operand})"
        return lambda operand: f"s_power({operand}, {exponent})"
    template = (FLOAT_TEMPLATES if is_float else INTEGER_TEMPLATES).get(name)
    return template.format if template else None


def cost_of(name: str) -> int:
    """How many operations the expression of an element counts as."""
    template = FLOAT_TEMPLATES.get(name, "")
    if name in UNCHANGED:
        return 0
    return EXPENSIVE if "f(" in template or "s_logistic" in template else 1


REDUCTIONS = {
    "reduce_sum": ("add", "0"),
    "reduce_prod": ("mul", "1"),
    "reduce_max": ("max", ""),
    "reduce_min": ("min", ""),
    "reduce_and": ("and", "1"),
    "reduce_or": ("or", "0"),
    "reduce_xor": ("xor", "0"),
}
"""Operation of each reduction, and the value it begins with, unless it is an extreme."""
ACCUMULATIONS = {"cumsum": "add", "cumprod": "mul", "cummax": "max", "cummin": "min"}


def combined(operation: str, kind: Kind, left: str, right: str) -> str:
    """Two numbers in one, by the name of a primitive."""
    templates = FLOAT_TEMPLATES if kind == "float" else INTEGER_TEMPLATES
    return templates[operation].format(left, right)


def start_of_reduction(name: str, kind: Kind) -> str:
    """The value that a reduction begins with."""
    operation, start = REDUCTIONS[name]
    if start:
        return start
    is_max = operation == "max"
    if kind == "float":
        return "-INFINITY" if is_max else "INFINITY"
    return "INT32_MIN" if is_max else "INT32_MAX"


def _conversion(old: Any, new: Any) -> Callable[[str], str]:
    to_float, from_float = (jnp.issubdtype(d, jnp.floating) for d in (new, old))
    if jnp.issubdtype(new, jnp.complexfloating):
        raise S2C2AError("complex numbers cannot be exported to C")
    boolean = jnp.dtype(bool)
    if new is boolean and old is not boolean:
        return lambda operand: f"({operand} != 0)"
    if to_float and not from_float:
        return lambda operand: f"((float){operand})"
    if from_float and not to_float:
        return lambda operand: f"((int32_t){operand})"
    return lambda operand: operand
