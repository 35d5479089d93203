"""The locked rows' null space and the robust inverse, at singularities and away from them."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
import pytest

from kinqp.formulations import Mode, factor_fixed_rows, robust_inverse
from kinqp.formulations.inverse import squared_singular_value_estimate
from tests.formulations.reference import (
    DAMPING_MAX,
    MODES,
    THRESHOLD,
    damped_inverse,
    evaluator,
    null_projector,
    rows_at,
)
from tests.robots.arms import arm

if TYPE_CHECKING:
    from tests.formulations.reference import Array

ROBOT = arm("lbr_med14")
# The projection leaves two or so roundings of J_free in J_bar; the rest of the inverse, (J_bar J_bar' + lambda^2 I)^-1,
# multiplies that by at most 1/lambda_max^2 = 400, at a singularity.
ROUNDING_LEFT = 1e-14 + 4e-16 / DAMPING_MAX**2
LOCKING = tuple(text for text in MODES if Mode.parse(text).m_fixed)
OFFSETS = (1e-3, 1e-6, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)


@functools.cache
def _inverse(m: int, nv: int) -> ca.Function:
    J, threshold, damping = ca.SX.sym("J", m, nv), ca.SX.sym("threshold"), ca.SX.sym("damping")
    return ca.Function("inverse", [J, threshold, damping], [ca.densify(robust_inverse(J, threshold, damping))])


def inverse(J: Array, threshold: float = THRESHOLD, damping_max: float = DAMPING_MAX) -> Array:
    return np.array(_inverse(*J.shape)(J, threshold, damping_max))


@functools.cache
def _factors(m: int, nv: int, k: int) -> ca.Function:
    J, rows, rhs = ca.SX.sym("J", m, nv), ca.SX.sym("rows", k, nv), ca.SX.sym("rhs", m)
    fixed = factor_fixed_rows(J)
    outputs = [fixed.basis, fixed.lower, fixed.project(rows), fixed.solve(rhs)]
    return ca.Function("factors", [J, rows, rhs], [ca.densify(output) for output in outputs])


def factors(J: Array, rows: Array | None = None, rhs: Array | None = None) -> tuple[Array, Array, Array, Array]:
    """Basis, lower, rows N_c, and the smallest solution of J x = rhs."""
    m, nv = J.shape
    rows = np.eye(nv) if rows is None else rows
    function = _factors(m, nv, len(rows))
    results = [np.array(part) for part in function(J, rows, np.zeros(m) if rhs is None else rhs)]
    return results[0], results[1], results[2], results[3][:, 0]


def with_singular_values(sigma: list[float], nv: int, seed: int) -> Array:
    rng = np.random.default_rng(seed)
    U = np.linalg.qr(rng.normal(size=(len(sigma), len(sigma))))[0]
    V = np.linalg.qr(rng.normal(size=(nv, nv)))[0]
    return np.asarray(U @ np.diag(sigma) @ V[:, : len(sigma)].T)


def command_matrix(mode: str, q: Array) -> tuple[Array, Array]:
    """J_fixed and J# as `cartesian-error` uses them; its rows C are J#."""
    instance = evaluator("lbr_med14", "cartesian-error", mode)(q=q, v=np.zeros(Mode.parse(mode).m_free))
    return instance.J_fixed, instance.qp.C


@functools.cache
def largest_gain(threshold: float = THRESHOLD, damping_max: float = DAMPING_MAX) -> float:
    """Largest sigma/(sigma^2 + lambda(sigma)^2) there is: another singular value than the smallest has less.

    The estimate s never exceeds sigma_min, but for its shift, 1e-6 sqrt(trace): far below the grid's resolution.
    """
    sigma = np.linspace(1e-6, 2 * threshold, 200_001)
    damping = damping_max * np.maximum(1 - (sigma / threshold) ** 2, 0)
    return float(np.max(sigma / (sigma**2 + damping**2)))


@pytest.mark.parametrize("mode", LOCKING)
def test_locked_rows_hold_on_random_states(mode: str) -> None:
    rng = np.random.default_rng(1)
    for _ in range(100):
        J_fixed, J_sharp = command_matrix(mode, ROBOT.random_configuration(rng))
        assert np.abs(J_fixed @ J_sharp).max() <= ROUNDING_LEFT


@pytest.mark.parametrize("mode", LOCKING)
def test_locked_rows_hold_where_they_are_rank_deficient(mode: str) -> None:
    J_fixed, J_sharp = command_matrix(mode, np.zeros(7))
    if mode == "fix-orientation":
        assert np.linalg.matrix_rank(J_fixed) == 2  # all axes in one plane
    assert np.isfinite(J_sharp).all()
    assert np.abs(J_fixed @ J_sharp).max() <= ROUNDING_LEFT


@pytest.mark.parametrize("mode", LOCKING)
@pytest.mark.parametrize("offset", OFFSETS)
def test_locked_rows_hold_near_rank_deficiency(mode: str, offset: float) -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        J_fixed, J_sharp = command_matrix(mode, offset * rng.normal(size=7))
        # A dropped row is off by 1e-10 of itself, entries of J_bar taken for rounding by 1e-12: the promise is 1e-9
        # relative to the motion.
        assert np.isfinite(J_sharp).all()
        assert np.abs(J_fixed @ J_sharp).max() <= 1e-9 * max(1.0, float(np.abs(J_sharp).max()))
        assert np.linalg.norm(J_sharp, 2) <= largest_gain() * (1 + 1e-6)


@pytest.mark.parametrize("mode", LOCKING)
@pytest.mark.parametrize("offset", [0.0, *OFFSETS, 1.0])
def test_basis_is_orthonormal_or_zero_row_by_row(mode: str, offset: float) -> None:
    rng = np.random.default_rng(3)
    for _ in range(10):
        q = offset * rng.normal(size=7)
        _, J_fixed = rows_at(ROBOT, Mode.parse(mode), q)
        basis, lower, _, _ = factors(J_fixed)
        kept = np.diag(lower) > 0.0
        np.testing.assert_allclose(basis @ basis.T, np.diag(kept.astype(float)), atol=1e-14)
        # The factors give the rows back but for what was dropped, and L is lower triangular.
        np.testing.assert_allclose(lower @ basis, J_fixed, atol=2e-10)
        np.testing.assert_array_equal(lower, np.tril(lower))


def test_dependent_rows_are_dropped() -> None:
    rng = np.random.default_rng(4)
    two = rng.normal(size=(2, 7))
    J = np.vstack((two[0], 3 * two[0], two[1], two[0] - two[1], np.zeros(7)))
    basis, lower, project, _ = factors(J)
    np.testing.assert_array_equal(np.diag(lower) > 0.0, [True, False, True, False, False])
    np.testing.assert_array_equal(basis[[1, 3, 4]], np.zeros((3, 7)))
    np.testing.assert_allclose(project, null_projector(two), atol=1e-14)


@pytest.mark.parametrize(("size", "kept"), [(1e-8, True), (2e-10, True), (5e-11, False), (1e-13, False)])
def test_what_counts_as_dependent(size: float, kept: bool) -> None:
    """A row is dropped where its part outside the others is below 1e-10 of it."""
    J = np.eye(7)[:1].repeat(2, axis=0)
    J[1, 3] = size
    basis, lower, _, _ = factors(J)
    assert bool(lower[1, 1] > 0.0) is kept
    np.testing.assert_allclose(np.linalg.norm(basis[1]), float(kept), atol=1e-15)


@pytest.mark.parametrize("mode", LOCKING)
def test_null_space_equals_that_of_the_singular_value_decomposition(mode: str) -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        J_free, J_fixed = rows_at(ROBOT, Mode.parse(mode), ROBOT.random_configuration(rng))
        _, _, J_bar, _ = factors(J_fixed, J_free)
        np.testing.assert_allclose(J_bar, J_free @ null_projector(J_fixed), atol=1e-11)
        _, _, projector, _ = factors(J_fixed)
        np.testing.assert_allclose(projector @ projector, projector, atol=1e-11)


def test_rounding_left_by_the_projection_becomes_zero() -> None:
    """A joint that the locked rows determine gets no coefficient at all, rather than one of random sign."""
    J_fixed = np.array([[0.6, 0.8, 0.0], [0.8, -0.6, 0.0]])  # locks joints 0 and 1
    _, _, left, _ = factors(J_fixed, np.array([[0.1, 0.7, 0.3], [0.3, 0.1, 2.0]]))
    np.testing.assert_array_equal(left, [[0.0, 0.0, 0.3], [0.0, 0.0, 2.0]])


@pytest.mark.parametrize("name", ["lbr_med14", "ur5e", "panda"])
@pytest.mark.parametrize("mode", MODES)
def test_equals_the_pseudo_inverse_away_from_singularities(name: str, mode: str) -> None:
    rng, robot, read = np.random.default_rng(6), arm(name), Mode.parse(mode)
    tried = 0
    for _ in range(60):
        J_free, J_fixed = rows_at(robot, read, robot.random_configuration(rng))
        J_bar = J_free @ null_projector(J_fixed)
        # The estimate may be m^(1/4) below sigma_min; a small threshold, because some arms are hardly ever far away.
        threshold = 0.02
        if np.linalg.svd(J_bar, compute_uv=False)[-1] < threshold * read.m_free**0.25 * 1.001:
            continue
        tried += 1
        np.testing.assert_allclose(inverse(J_bar, threshold), np.linalg.pinv(J_bar), rtol=1e-9, atol=1e-9)
    assert tried > 5


@pytest.mark.parametrize("sigma", [[1.0, 0.5, 0.01], [1.0, 0.07, 0.07], [0.6, 1e-9, 1e-9], [0.05], [1.0, 0.3, 0.3, 0]])
def test_equals_the_documented_formula_near_singularities(sigma: list[float]) -> None:
    J = with_singular_values(sigma, 7, seed=1)
    # 1e-9: the shift of the estimate, 1e-12 of the trace, against the threshold squared, 6.4e-3.
    np.testing.assert_allclose(inverse(J), damped_inverse(J), atol=1e-8)


@pytest.mark.parametrize("smallest", [0.0, 1e-12, 1e-6, 1e-3, 0.02, 0.05, 0.08, 0.1])
@pytest.mark.parametrize(("threshold", "damping_max"), [(0.08, 0.05), (0.2, 0.01), (0.01, 0.1)])
def test_gain_is_bounded(smallest: float, threshold: float, damping_max: float) -> None:
    bound = largest_gain(threshold, damping_max)
    for sigma in ([1.0, 0.5, smallest], [1.0, smallest, smallest], [smallest] * 3, [smallest]):
        J_sharp = inverse(with_singular_values(sigma, 7, seed=2), threshold, damping_max)
        assert np.isfinite(J_sharp).all()
        assert np.linalg.norm(J_sharp, 2) <= bound * (1 + 1e-6)
    if smallest < 1e-5:  # lambda = lambda_max for all, and sigma/(sigma^2 + lambda^2) <= 1/(2 lambda)
        J_sharp = inverse(with_singular_values([2.0, smallest], 7, seed=3), threshold, damping_max)
        assert np.linalg.norm(J_sharp, 2) <= 1 / (2 * damping_max) * (1 + 1e-6)


def test_no_motion_at_all_has_no_inverse_but_zero() -> None:
    np.testing.assert_array_equal(inverse(np.zeros((3, 7))), np.zeros((7, 3)))


@pytest.mark.parametrize("m", [1, 3, 6])
@pytest.mark.parametrize("smallest", [1e-3, 0.05, 0.5])
def test_estimate_lies_between_its_bounds(m: int, smallest: float) -> None:
    G = ca.SX.sym("G", m, m)
    estimate = ca.Function("estimate", [G], [ca.sqrt(squared_singular_value_estimate(G))])
    shapes = [
        [smallest] * m,
        [*[1.0] * (m - 1), smallest],
        list(np.linspace(smallest, 2.0, m)),
    ]
    for seed, sigma in enumerate(shapes):
        J = with_singular_values(sigma, 7, seed)
        found = float(estimate(J @ J.T))
        shifted = np.sqrt(smallest**2 + 1e-12 * np.sum(np.square(sigma)))
        assert smallest / m**0.25 * (1 - 1e-9) <= found <= shifted * (1 + 1e-9)
    # Both bounds are reached: all alike, and one alone.
    alike = float(estimate(with_singular_values([smallest] * m, 7, 9) @ with_singular_values([smallest] * m, 7, 9).T))
    assert alike == pytest.approx(smallest / m**0.25, rel=1e-6)


def test_inverse_and_its_slope_are_continuous_across_the_threshold() -> None:
    """Damping sets in with value and slope zero, so that the first difference changes only by O(step)."""

    def along(s: float) -> Array:
        J = np.zeros((2, 3))
        J[0, 0], J[1, 1] = 1.0, s
        return inverse(J)

    edge = (THRESHOLD**-4.0 - 1.0) ** -0.25  # where the estimate, (1 + s^-4)^(-1/4), is the threshold
    for step in (1e-4, 1e-5):
        below = (along(edge) - along(edge - step)) / step
        above = (along(edge + step) - along(edge)) / step
        # Curvature: 2/s^3 = 3.9e3 from 1/s, and with lambda = lambda_max 2 h/s at a distance h another
        # 2 (2 lambda_max/s)^2 / s^3 = 6.1e3, of which a first difference sees half.
        assert np.abs(above - below).max() <= 8e3 * step
    assert along(edge - 1e-3)[1, 1] < 1 / (edge - 1e-3) - 1e-4  # damping is on below
    assert along(edge + 1e-3)[1, 1] == pytest.approx(1 / (edge + 1e-3), rel=1e-12)  # and off above


@pytest.mark.parametrize("m", [1, 2, 3, 5])
def test_solve_gives_the_smallest_solution(m: int) -> None:
    rng = np.random.default_rng(m)
    for _ in range(20):
        J, rhs = rng.normal(size=(m, 7)), rng.normal(size=m)
        expected = np.linalg.lstsq(J, rhs, rcond=None)[0]
        np.testing.assert_allclose(factors(J, rhs=rhs)[3], expected, atol=1e-11 * np.linalg.cond(J))


def test_solve_gives_the_smallest_solution_of_consistent_dependent_rows() -> None:
    rng = np.random.default_rng(11)
    for _ in range(20):
        independent = rng.normal(size=(2, 7))
        J = rng.normal(size=(4, 2)) @ independent
        rhs = J @ rng.normal(size=7)
        expected = np.linalg.lstsq(J, rhs, rcond=1e-9)[0]
        np.testing.assert_allclose(factors(J, rhs=rhs)[3], expected, atol=1e-9)


@pytest.mark.parametrize("mode", LOCKING)
def test_solve_moves_the_locked_rows_of_an_arm(mode: str) -> None:
    rng = np.random.default_rng(12)
    for _ in range(20):
        _, J_fixed = rows_at(ROBOT, Mode.parse(mode), ROBOT.random_configuration(rng))
        rhs = rng.normal(size=len(J_fixed))
        qd = factors(J_fixed, rhs=rhs)[3]
        np.testing.assert_allclose(J_fixed @ qd, rhs, atol=1e-9)
        np.testing.assert_allclose(qd, np.linalg.pinv(J_fixed) @ rhs, atol=1e-9 * np.linalg.cond(J_fixed))
