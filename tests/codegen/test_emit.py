"""Emitted C against CasADi's own numbers, operation by operation."""

import functools
import itertools
import math
from collections.abc import Callable
from typing import Any

import casadi as ca
import cffi
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import kinqp.codegen.emit as emit_module
from kinqp.codegen.emit import EmitError, emit, number
from kinqp.codegen.render import math_header
from kinqp.solvers.native import build_library
from tests.codegen.compiled import QUICK_FLAGS

X, Y = ca.SX.sym("x"), ca.SX.sym("y")
SPECIAL = (
    *(0.0, 1.0, -1.0, 0.5, -0.5, 2.0, -2.5, 3.7, 1e-3, -1e-300, 1e-310, 1e15 + 0.5, -(2.0**52) - 1.0, 2.0**53, 1e300),
    *(math.inf, -math.inf),
)
# Where nothing overflows and no divisor is so small that its reciprocal does.
ORDINARY = (0.0, 1.0, -1.0, 0.5, -0.5, 2.0, -2.5, 3.7, 1e-3, 1e5)

# Those that IEEE 754 fixes to the last bit.
EXACT: dict[str, ca.SX] = {
    "add": X + Y,
    "subtract": X - Y,
    "multiply": X * Y,
    "divide": X / Y,
    "negate": -X,
    "inverse": 1 / X,
    "square": X**2,
    "twice": 2 * X,
    "root": ca.sqrt(X),
    "magnitude": ca.fabs(X),
    "floor": ca.floor(X),
    "ceiling": ca.ceil(X),
    "least": ca.fmin(X, Y),
    "most": ca.fmax(X, Y),
    "less": X < Y,
    "at_most": X <= Y,
    "equal": X == Y,
    "different": X != Y,
    "not_number": ca.logic_not(X),
    "not_less": ca.logic_not(X < Y),
    "not_not_less": ca.logic_not(ca.logic_not(X < Y)),
    "both": ca.logic_and(X < 1, Y),
    "either": ca.logic_or(X, Y > 1),
    "sign": ca.sign(X),
    "choice": ca.if_else(X < Y, X + 3, Y - 2),
    "choice_of_number": ca.if_else(X, Y + 1, Y - 1),
    "choice_of_both": ca.if_else(ca.logic_and(X > 0, Y > 0), X, Y),
    "choice_of_not": ca.if_else(ca.logic_not(X == Y), 1, 2),
    "comparison_twice": ca.if_else(X < Y, Y, X) + (X < Y),
    "sum_of_comparisons": (X < Y) + (X <= Y) * 2 + (X == Y) * 4,
    "comparison_of_comparisons": (X < 1) < (Y < 1),
    "negative_constants": X * -3.0 - (-4.5 - Y * -0.1),
    "subtract_negative": X - ca.SX(-2.0),
    "infinite_bound": ca.fmin(X, ca.SX.inf()),
    "minus_infinite_bound": ca.fmax(X, -ca.SX.inf()),
    "tiny": X + 5e-324,
    "constant": ca.SX(-7.25),
    "copy": X,
}
# Those of the C library, and divisions through a common reciprocal: a rounding more.
ROUNDED: dict[str, ca.SX] = {
    "sine": ca.sin(X),
    "cosine": ca.cos(X),
    "tangent": ca.tan(X),
    "arc_sine": ca.asin(X),
    "arc_cosine": ca.acos(X),
    "arc_tangent": ca.atan(X),
    "arc_tangent_2": ca.atan2(X, Y),
    "exponential": ca.exp(X),
    "logarithm": ca.log(X),
    "power": X**Y,
    "constant_power": X**2.5,
    "negative_power": X**-3,
    "hyperbolic_tangent": ca.tanh(X),
    "shared_divisor": X / Y + 3 / Y,
    "shared_inverse": 1 / Y - 5 * (X / Y),
}


@functools.cache
def library() -> dict[str, Callable[[float, float], float]]:
    """Compile all expressions, each as a function of its own."""
    texts, declarations = ["#include <math.h>", math_header()], []
    for name, expression in (EXACT | ROUNDED).items():
        lines = emit(ca.Function(name, [X, Y], [ca.densify(expression)]), ["x", "y"], ["out"])
        prototype = f"void op_{name}(const double *x, const double *y, double *out)"
        unused = "    (void)x; (void)y;"
        texts.append("\n".join([f"{prototype};", f"{prototype} {{", unused, *lines, "}"]))
        declarations.append(f"{prototype};")
    loaded, ffi = load("operations", "\n".join(texts), "\n".join(declarations))

    def call(name: str) -> Callable[[float, float], float]:
        function = getattr(loaded, f"op_{name}")

        def run(x: float, y: float) -> float:
            out = ffi.new("double[1]")
            function(ffi.new("double[1]", [x]), ffi.new("double[1]", [y]), out)
            return float(out[0])

        return run

    return {name: call(name) for name in EXACT | ROUNDED}


def load(name: str, text: str, declarations: str) -> tuple[Any, Any]:
    """Compile a C text with the steps' flags, all warnings errors; return (library, ffi)."""
    ffi = cffi.FFI()
    ffi.cdef(declarations)
    flags = (*QUICK_FLAGS, "-Wall", "-Wextra", "-Wno-unused-function", "-Werror")
    return ffi.dlopen(str(build_library(f"kinqp_test_{name}", {f"{name}.c": text}, flags=flags))), ffi


@pytest.mark.parametrize("name", EXACT)
def test_exact_operations_give_casadis_numbers(name: str) -> None:
    function, run = ca.Function("f", [X, Y], [EXACT[name]]), library()[name]
    for x, y in itertools.product(SPECIAL, repeat=2):
        np.testing.assert_array_equal(run(x, y), float(function(x, y)), err_msg=f"{name}({x!r}, {y!r})")


@pytest.mark.parametrize("name", ROUNDED)
def test_rounded_operations_give_casadis_numbers(name: str) -> None:
    function, run = ca.Function("f", [X, Y], [ROUNDED[name]]), library()[name]
    for x, y in itertools.product(ORDINARY, repeat=2):
        if y == 0.0 and name.startswith("shared"):
            continue  # inf * 0 is not 0 / 0; no formulation may divide by zero
        np.testing.assert_allclose(run(x, y), float(function(x, y)), rtol=1e-14, atol=1e-15, err_msg=f"({x!r}, {y!r})")


def test_every_operation_of_the_table_is_tested() -> None:
    seen = set()
    for expression in (EXACT | ROUNDED).values():
        function = ca.Function("f", [X, Y], [expression])
        seen |= {function.instruction_id(i) for i in range(function.n_instructions())}
    # ASSIGN never survives into an SX function.
    assert set(emit_module._OPERATIONS) - seen <= {ca.OP_ASSIGN}


@pytest.mark.parametrize(
    ("expression", "operation"),
    [(ca.erf(X), ca.OP_ERF), (ca.fmod(X, Y), ca.OP_FMOD), (ca.sinh(X), ca.OP_SINH), (ca.hypot(X, Y), ca.OP_HYPOT)],
)
def test_unsupported_operations_are_named(expression: ca.SX, operation: int) -> None:
    with pytest.raises(EmitError, match=rf"operation {operation} of bending: expected one with a C counterpart"):
        emit(ca.Function("bending", [X, Y], [expression]), ["x", "y"], ["out"])


def test_shared_divisors_divide_once() -> None:
    inputs = ca.SX.sym("x", 3)
    function = ca.Function("f", [inputs], [ca.vertcat(inputs[0] / inputs[2], inputs[1] / inputs[2])])
    text = "\n".join(emit(function, ["x"], ["out"]))
    assert text.count("/") == 1
    once = "\n".join(emit(ca.Function("f", [inputs], [inputs[0] / inputs[2]]), ["x"], ["out"]))
    assert "x[0] / x[2]" in once


def test_matrices_are_written_column_by_column() -> None:
    matrix = ca.SX.sym("m", 2, 3)
    lines = emit(ca.Function("f", [matrix], [2 * matrix[1, 2]]), ["m"], ["out"])
    assert lines == ["const double a1 = 2.0 * m[5];", "out[0] = a1;"]


def test_tabulated_angles_read_the_tables() -> None:
    q = ca.SX.sym("q", 2)
    expression = ca.sin(q[1]) + ca.cos(q[0]) + ca.sin(2 * q[1])
    lines = emit(ca.Function("f", [q], [expression]), ["in->q"], ["out"], {"in->q[0]": "[0]", "in->q[1]": "[1]"})
    text = "\n".join(lines)
    assert "= sine[1];" in text
    assert "= cosine[0];" in text
    assert text.count("sin(") == 1


def test_conditions_that_only_choose_leave_no_unread_numbers() -> None:
    text = "\n".join(emit(ca.Function("f", [X, Y], [ca.if_else(X < Y, X, Y)]), ["x", "y"], ["out"]))
    names = [line.split()[2] for line in text.splitlines() if line.startswith("const double ")]
    assert names
    assert all(text.count(name) > 1 for name in names)


@given(st.floats(allow_nan=False))
def test_numbers_keep_their_bits(value: float) -> None:
    text = number(value)
    if math.isinf(value):
        assert text == ("INFINITY" if value > 0.0 else "-INFINITY")
    else:
        assert np.float64(float(text)).tobytes() == np.float64(value).tobytes()
        # A floating-point literal, never an integer: 1 / 2 is 0 in C.
        assert any(mark in text for mark in ".e")


def test_the_compiler_reads_the_same_bits() -> None:
    values = [0.0, -0.0, 1.0, -2.0, 0.1, 1 / 3, 5e-324, -2.2250738585072014e-308, 1.7976931348623157e308, 1e22]
    values += [math.inf, -math.inf, math.pi, 123456789012345680.0]
    listed = ", ".join(number(value) for value in values)
    text = f"#include <math.h>\nconst double values[] = {{{listed}}};\n"
    loaded, ffi = load("numbers", text, f"extern const double values[{len(values)}];")
    assert bytes(ffi.buffer(loaded.values)) == np.array(values).tobytes()
