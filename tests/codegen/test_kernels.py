"""Kernels against the formulas that they stand for, and what is laid out around them."""

import functools
from dataclasses import dataclass
from typing import Any, ClassVar

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from kinqp.codegen.emit import Call, needed_for
from kinqp.codegen.kernels import KERNELS, LANES, Kernel, agree, pack, padded, used
from kinqp.codegen.model import step_code
from kinqp.codegen.render import _template_text, math_header
from kinqp.formulations import (
    Formulation,
    Mode,
    QuadraticProgram,
    Tick,
    factor_fixed_rows,
    get_formulation,
    lower,
    robust_inverse,
    velocity_bounds,
)
from tests.codegen.compiled import compiled, interpreted, ticks
from tests.codegen.test_emit import load
from tests.robots.arms import arm

Array = NDArray[np.float64]


@functools.cache
def kernel(name: str, sizes: tuple[int, ...]) -> Any:
    """Compile one kernel for fixed sizes, all arrays through pointers."""
    spec: Kernel = KERNELS[name]
    arguments = [f"x{k}[0]" if layout == "number" else f"x{k}" for k, layout in enumerate(spec.inputs)]
    results = [f"y{k}" for k in range(len(spec.results))]
    parameters = [f"const double *x{k}" for k in range(len(spec.inputs))] + [f"double *{y}" for y in results]
    prototype = f"void call({', '.join(parameters)});"
    listed = ", ".join([*map(str, sizes), *arguments, *results])
    text = "\n".join(
        [
            math_header(),
            f"enum {{ KINQP_MOST = {padded(sizes[-1])}, KINQP_LARGEST = 8 }};",
            _template_text("kernels/common.h"),
            _template_text(f"kernels/{name}.h"),
            prototype,
            f"{prototype[:-1]} {{ kinqp_{name}({listed}); }}",
        ]
    )
    return load(f"kernel_{name}_{'_'.join(map(str, sizes))}", text, prototype)


def call(name: str, sizes: tuple[int, ...], inputs: list[Array], shapes: list[tuple[int, int]]) -> list[Array]:
    library, ffi = kernel(name, sizes)
    spec = KERNELS[name]
    given = [lay_out(np.atleast_2d(x), layout) for x, layout in zip(inputs, spec.inputs, strict=True)]
    made = [lay_out(np.zeros(shape), layout) for shape, layout in zip(shapes, spec.results, strict=True)]
    library.call(*(ffi.cast("double *", ffi.from_buffer(array)) for array in (*given, *made)))
    return [
        array.T[: shape[0]] if layout == "columns" else array[:, : shape[1]]
        for array, shape, layout in zip(made, shapes, spec.results, strict=True)
    ]


def lay_out(matrix: Array, layout: str) -> Array:
    if layout == "columns":
        matrix = matrix.T
    missing = padded(matrix.shape[1]) - matrix.shape[1] if layout in ("rows", "columns") else 0
    return np.ascontiguousarray(np.pad(matrix, ((0, 0), (0, missing))))


def difficult_rows(rng: np.random.Generator, m: int, n: int) -> Array:
    """Draw rows: ordinary, nearly dependent, dependent, zero, of unequal length, without one joint."""
    rows = rng.normal(size=(m, n))
    kind = rng.integers(6)
    if kind == 1 and m > 1:
        rows[-1] = rows[0] + 10.0 ** rng.uniform(-12, -1) * rows[-1]
    elif kind == 2 and m > 1:
        rows[-1] = 2.0 * rows[0]
    elif kind == 3:
        rows[rng.integers(m)] = 0.0
    elif kind == 4:
        rows *= 10.0 ** rng.uniform(-3, 3, (m, 1))
    elif kind == 5:
        rows[:, rng.integers(n)] = 0.0
    return rows


@pytest.mark.parametrize(("k", "m", "n"), [(3, 3, 7), (1, 5, 7), (4, 2, 6), (2, 4, 9), (3, 3, 4), (2, 1, 3)])
def test_locked_rows(k: int, m: int, n: int) -> None:
    J, F, v_fixed, v = ca.SX.sym("J", k, n), ca.SX.sym("F", m, n), ca.SX.sym("f", m), ca.SX.sym("v", k)
    factors = factor_fixed_rows(F)
    qd = factors.solve(v_fixed)
    formula = ca.Function("locked", [J, F, v_fixed, v], [factors.project(J), qd, v - J @ qd])
    rng = np.random.default_rng(k + 10 * m)
    dependent = 0
    for trial in range(600):
        rows, locked = rng.normal(size=(k, n)), difficult_rows(rng, m, n)
        if trial % 5 == 0 and k > 0:
            rows[0] = rng.normal(size=m) @ locked  # nothing of it is left
        asked = [rng.normal(size=k), np.zeros(m) if trial % 3 else locked @ rng.normal(size=n)]
        got = call("locked_rows", (k, m, n), [rows, locked, asked[1], asked[0]], [(k, n), (n, 1), (1, k)])
        wanted = [np.asarray(x) for x in formula(rows, locked, asked[1], asked[0])]
        # Near dependent rows the direction of what is left is rounding, of either; what must hold is that it is locked.
        share = np.abs(locked) @ np.abs(got[0]).T + 1e-300
        assert (np.abs(locked @ got[0].T) <= 1e-10 * np.maximum(share, np.linalg.norm(locked, axis=1)[:, None])).all()
        # A row counts by its direction, whatever its unit.
        length = np.linalg.norm(locked, axis=1, keepdims=True)
        singular = np.linalg.svd(locked / np.where(length > 0.0, length, 1.0), compute_uv=False)
        if singular[-1] < 1e-4:
            dependent += 1
            continue
        np.testing.assert_allclose(got[0], wanted[0], rtol=0, atol=1e-11 * np.abs(rows).max())
        np.testing.assert_allclose(got[1], wanted[1], rtol=1e-9, atol=1e-11 * (1.0 + np.abs(wanted[1]).max()))
        np.testing.assert_allclose(got[2].T, wanted[2], rtol=1e-9, atol=1e-10 * (1.0 + np.abs(wanted[1]).max()))
    assert 0 < dependent < 450


@pytest.mark.parametrize(("m", "n"), [(1, 7), (2, 7), (3, 7), (3, 3), (4, 6), (6, 7)])
def test_robust_inverse(m: int, n: int) -> None:
    J, threshold, most = ca.SX.sym("J", m, n), ca.SX.sym("t"), ca.SX.sym("d")
    v, offset = ca.SX.sym("v", m), ca.SX.sym("offset", n)
    inverse = robust_inverse(J, threshold, most)
    formula = ca.Function("inverse", [J, threshold, most, v, offset], [inverse, offset + inverse @ v])
    rng = np.random.default_rng(m)
    damped = 0
    for _ in range(600):
        U, _, Vt = np.linalg.svd(rng.normal(size=(m, n)), full_matrices=False)
        singular = 10.0 ** rng.uniform(-9, 0, m) * rng.choice([0.0, 1.0, 1.0, 1.0], m)
        if rng.random() < 0.4:
            singular = rng.uniform(0.05, 1.2, m)
        rows = (U * singular) @ Vt
        asked = [rng.normal(size=m), rng.normal(size=(n, 1))]
        given = [rows, np.array([0.08]), np.array([0.05]), *asked]
        got = call("robust_inverse", (m, n), given, [(n, m), (n, 1)])
        damped += singular.min() < 0.08
        for mine, wanted in zip(got, map(np.asarray, formula(rows, 0.08, 0.05, *asked)), strict=True):
            np.testing.assert_allclose(mine, wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())
    assert 100 < damped < 580


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 7, 8, 30])
@pytest.mark.parametrize("name", ["viable", "thesis"])
def test_bounds(name: str, n: int) -> None:
    symbols = [*(ca.SX.sym(f"x{k}", n) for k in range(5)), ca.SX.sym("dt")]
    formula = ca.Function("bounds", symbols, list(velocity_bounds(name, *symbols)))
    rng = np.random.default_rng(n)
    for _ in range(300):
        q_min, q_max = -rng.uniform(0.1, 3.0, n), rng.uniform(0.1, 3.0, n)
        q = rng.uniform(q_min - 0.1, q_max + 0.1)
        at = rng.random(n) < 0.4
        q[at] = q_max[at] - rng.choice([0.0, 1e-9, 1e-5, 1e-5 + 1e-12, 3e-5, -1e-9], at.sum())
        q_min[rng.random(n) < 0.2] = -np.inf
        values = [q, q_min, q_max, rng.uniform(0.1, 3.0, n), rng.uniform(1.0, 20.0, n), np.array([1e-3])]
        got = call(f"{name}_bounds", (n,), values, [(1, n), (1, n)])
        for mine, wanted in zip(got, formula(*values), strict=True):
            np.testing.assert_allclose(mine[0], np.asarray(wanted)[:, 0], rtol=1e-12, atol=1e-15)


@dataclass(frozen=True)
class LooksThrough(Formulation):
    """Its rows hold a derivative of the null space by the joint positions, which no symbol has."""

    name: ClassVar[str] = "looks-through"

    def declare(self, qp: QuadraticProgram, tick: Tick) -> None:
        qd = qp.variable("qd", tick.nv)
        size = ca.sumsqr(tick.J_bar)
        qp.minimize(tick.J_free @ qd - tick.v, name="task")
        qp.minimize(qd, weight=1e-3, name="speed")
        qp.between(-1.0, ca.jacobian(size, tick.q) @ qd, 1.0, name="change")
        qp.between(tick.qd_lo, qd, tick.qd_hi, name="joint limits")
        qp.command(qd)


def test_a_declaration_that_looks_through_a_cut_is_generated_from_formulas() -> None:
    mode = Mode.fix_orientation()
    plain, cut = (lower(LooksThrough(), arm("ur5e"), mode, cut=c) for c in (False, True))
    assert not agree(plain, cut)
    assert step_code(arm("ur5e"), LooksThrough(), [mode], "k").modes[0].kernels == ()
    for name in ("cartesian-error", "joint-space"):
        plain, cut = (lower(get_formulation(name), arm("ur5e"), mode, cut=c) for c in (False, True))
        assert agree(plain, cut)


def test_the_two_formulations_use_kernels() -> None:
    def kernels(name: str) -> set[str]:
        return set(step_code(arm("ur5e"), get_formulation(name), [Mode.fix_orientation()], "k").modes[0].kernels)

    assert kernels("cartesian-error") == {"locked_rows", "robust_inverse", "viable_bounds"}
    assert kernels("cartesian-error(bounds=thesis)") == {"locked_rows", "robust_inverse", "thesis_bounds"}
    assert kernels("joint-space") == {"locked_rows", "viable_bounds"}


def test_drift_is_corrected_alike() -> None:
    for name in ("cartesian-error", "joint-space"):
        for _, q, v in ticks("lbr_med14", "fix-orientation", 12, seed=3):
            asked = {"v_fixed": [1e-3, -2e-3, 5e-4]}
            mine = compiled("lbr_med14", name, "fix-orientation", quick=True)(q, v, **asked)
            other = interpreted("lbr_med14", name, "fix-orientation")(q, v, **asked)
            if mine.status is other.status and other.status.value == "solved":
                np.testing.assert_allclose(mine.qd, other.qd, rtol=0, atol=1e-7)


def test_the_admissible_point_follows_drift_correction() -> None:
    """Kernels that only the feasible mode needs read the padded rows of the tick, which a capped one starts from."""
    code = step_code(arm("lbr_med14"), get_formulation("joint-space"), [Mode.fix_orientation()], "k").modes[0]
    assert any(line.startswith("kinqp_locked_rows(3, 3, 7, jacobian, locked, ") for line in code.start_body)
    assert not any(line.startswith("kinqp_put(") for line in code.start_body)
    step = compiled("lbr_med14", "joint-space", "fix-orientation", quick=True, feasible=True, max_iterations=0)
    rng, capped = np.random.default_rng(6), 0
    for _ in range(60):
        q = 0.8 * arm("lbr_med14").random_configuration(rng)
        drift = 1e-3 * rng.normal(size=3)
        result = step(q, 3.0 * rng.normal(size=3), v_fixed=drift)
        if result.status.value == "max_iterations":
            capped += 1
            np.testing.assert_allclose(arm("lbr_med14").jacobian(q)[3:] @ result.qd, drift, rtol=0, atol=1e-9)
    assert capped > 20


def test_unused_cuts_are_left_out() -> None:
    tick = Tick(arm("ur5e"), Mode.fix_orientation(), cut=True)
    inverse, _ = tick.inverse, tick.qd_lo
    assert [cut.kernel for cut in tick.cuts] == ["locked_rows", "robust_inverse", "viable_bounds"]
    assert [cut.kernel for cut in used(tick.cuts, [inverse])] == ["locked_rows", "robust_inverse"]
    assert used(tick.cuts, [tick.J_free]) == []


def test_statements_are_split_by_need() -> None:
    kernel_call = Call("f(m, out);", (), ("out",))
    lines = [
        "const double a1 = 1.0;",
        "m[0] = a1;",
        "const double a2 = a1;",
        kernel_call.text,
        "x[0] = out[1];",
        "y[0] = a2;",
    ]
    assert needed_for(lines, ["y"]) == ([lines[0], lines[2], lines[5]], [lines[1], lines[3], lines[4]])
    assert needed_for(lines, ["x"], [kernel_call])[1] == [lines[2], lines[5]]


def test_padded_rows_are_written_by_four() -> None:
    lines = ["m[0] = a1;", "m[4] = a5;", "k[0] = a2;", "m[2] = 0.0;", "m[1] = a3;"]
    assert LANES == 4
    assert pack(lines, ["m"]) == [
        "kinqp_put(m + 4, a5, 0.0, 0.0, 0.0);",
        "k[0] = a2;",
        "kinqp_put(m + 0, a1, a3, 0.0, 0.0);",
    ]
    assert pack(lines, []) == lines
