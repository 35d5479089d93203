"""The least-distance core in C, with sizes known at run time and at compile time."""

from collections.abc import Callable
from typing import Any

import cffi
import numpy as np
import pytest

from kinqp.solvers import Status
from kinqp.solvers.active_set import fixed_size_sources
from kinqp.solvers.active_set.library import load
from kinqp.solvers.native import build_library, declarations

_SHIM = """
#define KINQP_AS_N {n}
#define KINQP_AS_M {m}
#include "kinqp_as_fixed.h"
int fixed_{n}_{m}(const double *M, const double *lo, const double *hi, const double *admissible,
                  const kinqp_as_options *o, double *w, double *z, int *active, kinqp_as_result *r);
int fixed_{n}_{m}(const double *M, const double *lo, const double *hi, const double *admissible,
                  const kinqp_as_options *o, double *w, double *z, int *active, kinqp_as_result *r) {{
    kinqp_as_fixed_state s;
    return (int)kinqp_as_fixed_solve(&s, M, lo, hi, NULL, admissible, o, w, z, active, r);
}}
"""
SIZES = [(3, 7), (1, 4), (6, 7), (7, 20)]
Core = Callable[..., tuple[Status, np.ndarray, np.ndarray, int]]
_STATUS = (Status.SOLVED, Status.MAX_ITERATIONS, Status.PRIMAL_INFEASIBLE)


@pytest.fixture(scope="module")
def cores() -> dict[str, Core]:
    """The core by name: ``run-time``, and ``fixed``, which finds the instance for the sizes of its arguments."""
    shims = {f"shim_{n}_{m}.c": _SHIM.format(n=n, m=m) for n, m in SIZES}
    library = build_library("test_fixed_core", fixed_size_sources() | shims)
    fixed_ffi = cffi.FFI()
    texts = fixed_size_sources()
    fixed_ffi.cdef(declarations(texts["kinqp_status.h"]) + declarations(texts["kinqp_as.h"]))
    for text in shims.values():
        fixed_ffi.cdef(declarations(text[text.index("int fixed") : text.index(";") + 1]))
    fixed = fixed_ffi.dlopen(str(library))
    ffi, lib = load()

    def solve_fixed(
        M: np.ndarray, lo: np.ndarray, hi: np.ndarray, admissible: np.ndarray | None = None, **options: float
    ) -> tuple[Status, np.ndarray, np.ndarray, int]:
        m, n = M.shape
        function = getattr(fixed, f"fixed_{n}_{m}")
        return _call(fixed_ffi, lib_options(options), function, (), M, lo, hi, (), admissible)

    def solve_run_time(
        M: np.ndarray, lo: np.ndarray, hi: np.ndarray, admissible: np.ndarray | None = None, **options: float
    ) -> tuple[Status, np.ndarray, np.ndarray, int]:
        m, n = M.shape
        state = ffi.new("kinqp_as_state *")
        memory = ffi.new("double[]", -(-lib.kinqp_as_workspace_size(n, m) // 8))
        lib.kinqp_as_setup(state, n, m, memory)
        return _call(ffi, lib_options(options), lib.kinqp_as_solve, (state,), M, lo, hi, (ffi.NULL,), admissible)

    def lib_options(options: dict[str, float]) -> dict[str, Any]:
        defaults = {"violation": 1e-12, "dependence": 1e-10, "inconsistent": 1e-9, "scale": 0.0}
        return defaults | {"max_iterations": 300, "warm": 0, "polish": 1} | options

    return {"fixed": solve_fixed, "run-time": solve_run_time}


def _call(
    ffi: Any,
    options: dict[str, Any],
    function: Any,
    before: tuple[Any, ...],
    M: np.ndarray,
    lo: np.ndarray,
    hi: np.ndarray,
    target: tuple[Any, ...],
    admissible: np.ndarray | None,
) -> tuple[Status, np.ndarray, np.ndarray, int]:
    w, z, active = np.full(M.shape[1], np.nan), np.full(len(M), np.nan), np.zeros(len(M), dtype=np.intc)
    result = ffi.new("kinqp_as_result *")
    data = [ffi.from_buffer("double[]", np.ascontiguousarray(array)) for array in (M, lo, hi)]
    start = ffi.NULL if admissible is None else ffi.from_buffer("double[]", admissible)
    out = [ffi.from_buffer("double[]", w), ffi.from_buffer("double[]", z), ffi.from_buffer("int[]", active)]
    status = function(*before, *data, *target, start, ffi.new("kinqp_as_options *", options), *out, result)
    return _STATUS[status], w, z, result.iterations


def arm_like(rng: np.random.Generator, n: int = 3, m: int = 7) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Draw the formulation `cartesian-error`: columns of a pseudo-inverse, joints at their limits, a command v.

    Returns M, lo, hi of the shifted rows, and v: then -v, zero motion, satisfies every row, some with equality.
    """
    M = np.linalg.pinv(rng.normal(size=(n, m)) * np.where(rng.random((n, 1)) < 0.1, 1e-2, 1))
    v = 0.4 * rng.normal(size=n)
    lower, upper = -2 * rng.random(m), 2 * rng.random(m)
    lower[rng.random(m) < 0.25] = 0
    upper[rng.random(m) < 0.25] = 0
    return M, lower - M @ v, upper - M @ v, v


@pytest.mark.parametrize(("n", "m"), SIZES)
def test_compile_time_sizes_give_the_same_answers(cores: dict[str, Core], n: int, m: int) -> None:
    rng = np.random.default_rng(17)
    steps = 0
    for _ in range(400):
        M, lo, hi, v = arm_like(rng, n, m)
        (one, w, z, count), (two, x, y, _) = (core(M, lo, hi, scale=np.linalg.norm(v)) for core in cores.values())
        steps += count
        assert one is two is Status.SOLVED
        # Inner products of four or more are summed in another order.
        np.testing.assert_allclose(w, x, rtol=0, atol=0 if n < 4 else 1e-9)
        if n < 4:
            assert z.tobytes() == y.tobytes()
        np.testing.assert_allclose(w + M.T @ z, 0, atol=1e-9)
    assert steps > 200


@pytest.mark.parametrize("name", ["fixed", "run-time"])
@pytest.mark.parametrize(("n", "m"), SIZES)
def test_at_any_cap_the_feasible_mode_satisfies_every_row(cores: dict[str, Core], name: str, n: int, m: int) -> None:
    rng = np.random.default_rng(23)
    stopped = exact = 0
    for _ in range(300):
        M, lo, hi, v = arm_like(rng, n, m)
        scale = float(np.linalg.norm(v))
        best = cores[name](M, lo, hi, scale=scale)[1]
        # The bounds themselves are lo - M v: exact only to the rounding of M v.
        slack = 2e-12 * scale * np.linalg.norm(M, axis=1)
        for cap in range(11):
            status, w, _, iterations = cores[name](M, lo, hi, -v, scale=scale, max_iterations=cap)
            assert iterations <= cap
            assert (M @ w <= hi + slack).all()
            assert (M @ w >= lo - slack).all()
            if status is Status.SOLVED:
                np.testing.assert_allclose(w, best, rtol=0, atol=1e-9 * (1 + scale))
                exact += 1
            else:
                assert status is Status.MAX_ITERATIONS
                stopped += 1
    assert stopped > 200
    assert exact > 300


@pytest.mark.parametrize("name", ["fixed", "run-time"])
def test_core_proves_infeasibility(cores: dict[str, Core], name: str) -> None:
    rng = np.random.default_rng(31)
    proven = 0
    for _ in range(300):
        M = rng.integers(-2, 3, (7, 3)).astype(float)
        lo = rng.integers(-3, 3, 7).astype(float)
        hi = lo + rng.integers(1, 9, 7)
        status, w, z, _ = cores[name](M, lo, hi)
        if status is Status.SOLVED:
            assert (M @ w <= hi + 1e-9).all()
            assert (M @ w >= lo - 1e-9).all()
            np.testing.assert_allclose(w + M.T @ z, 0, atol=1e-9)
        else:
            assert status is Status.PRIMAL_INFEASIBLE
            assert np.abs(M.T @ z).max() < 1e-9
            assert hi @ np.maximum(z, 0) + lo @ np.minimum(z, 0) < -1e-9
            proven += 1
    assert 50 < proven < 280


@pytest.mark.parametrize("kind", ["run-time", "fixed"])
def test_rows_that_contradict_each_other_by_rounding_do_not_send_it_round_in_circles(
    cores: dict[str, Core], kind: str
) -> None:
    """Rows 0 and 1 are one but for 2.8e-12 along row 2's normal, and cross by 2e-12, just above the tolerance.

    Row 1 drops row 2, is then found satisfied as far as rounding can tell, and has to look again when row 2 is back.
    """
    M = np.zeros((7, 3))
    M[0, 0], M[1, :2], M[2, 1], M[3:, 2] = 1.0, (-1.0, 2.8e-12), 1.0, 1.0
    lo, hi = np.full(7, -np.inf), np.full(7, np.inf)
    hi[:3] = -1.0, 1.0 - 4.8e-12, -1.0
    status, w, z, iterations = cores[kind](M, lo, hi)
    assert status is Status.SOLVED
    np.testing.assert_allclose(w, [-1.0, -1.0, 0.0], rtol=0, atol=1e-11)
    np.testing.assert_allclose(z[[0, 2]], [1.0, 1.0], rtol=0, atol=1e-9)
    assert iterations < 40
