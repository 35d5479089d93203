"""The numbers by which answers are judged."""

import math

import numpy as np
import pytest

from kinqp.solvers import (
    QP,
    is_dual_infeasibility_certificate,
    is_primal_infeasibility_certificate,
    residuals,
)

INF = np.inf
NONE = np.empty(0)
QP_ALL = QP(H=[[2, 0], [0, 1]], g=[1, -1], A=[[1, 1]], b=[1], C=[[1, -1]], l=[-2], u=[3], lb=[-INF, 0], ub=[4, INF])


def vec(*numbers: float) -> np.ndarray:
    return np.array(numbers, dtype=float)


def test_values_by_hand() -> None:
    # A x - b = 3 - 2 - 1 = 0; C x = 5 exceeds 3 by 2; x1 = -2 is below 0 by 2; Hx = (6, -2).
    # Stationarity: (6 + 1 + 5 + 2 + 0, -2 - 1 + 5 - 2 - 1) = (14, -1).
    # Gap: x'Hx = 22, g'x = 5, b'y = 5, u z = 6, and lb1 = 0 adds nothing: 38.
    r = residuals(QP_ALL, vec(3, -2), vec(5), vec(2), vec(0, -1))
    assert (r.primal, r.dual, r.gap) == (2, 14, 38)
    # |C|(1 + |x|) = 4 + 3, the box 1 + 2; the gradient's size is max(2, 6, 1, |A'y + C'z + z_box| = 7) = 7.
    assert r.primal_scaled == pytest.approx(2 / 3)
    assert r.dual_scaled == pytest.approx(14 / 7)
    assert r.gap_scaled == pytest.approx(38 / (7 * 4))
    assert r.worst == 38
    assert r.worst_scaled == pytest.approx(2)


def test_equality_counts_both_ways() -> None:
    qp = QP(H=np.eye(1), g=[0], A=[[1]], b=[2])
    for x in (1.5, 2.5):
        assert residuals(qp, vec(x), vec(-2), NONE, vec(0)).primal == 0.5


def test_a_multiplier_on_an_absent_side_does_not_count() -> None:
    qp = QP(H=np.eye(1), g=[1], ub=[5])
    # Stationarity would hold with z_box = -1, but there is no lower side.
    r = residuals(qp, vec(0), NONE, NONE, vec(-1))
    assert r.dual == 1
    assert math.isfinite(r.gap)


@pytest.mark.parametrize("factor", [1e-8, 1e-3, 1e3, 1e8])
def test_scaled_values_do_not_depend_on_units_of_rows_or_cost(factor: float) -> None:
    x, y, z, box = vec(3, -2), vec(5), vec(2), vec(0, -1)
    plain = residuals(QP_ALL, x, y, z, box)
    q = QP_ALL
    rows = QP(
        H=q.H, g=q.g, A=factor * q.A, b=factor * q.b, C=factor * q.C, l=factor * q.l, u=factor * q.u, lb=q.lb, ub=q.ub
    )
    cost = QP(H=factor * q.H, g=factor * q.g, A=q.A, b=q.b, C=q.C, l=q.l, u=q.u, lb=q.lb, ub=q.ub)
    for other in (
        residuals(rows, x, y / factor, z / factor, box),
        residuals(cost, x, factor * y, factor * z, factor * box),
    ):
        assert other.primal_scaled == pytest.approx(plain.primal_scaled)
        assert other.dual_scaled == pytest.approx(plain.dual_scaled)
        assert other.gap_scaled == pytest.approx(plain.gap_scaled)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
def test_unusable_numbers_are_infinitely_wrong(bad: float) -> None:
    good = [vec(3, -2), vec(5), vec(2), vec(0, -1)]
    assert residuals(QP_ALL, vec(bad, 0), *good[1:]).worst_scaled == math.inf
    for i in (1, 2, 3):
        if abs(bad) == 1e300:
            continue
        parts = [vector.copy() for vector in good]
        parts[i][0] = bad
        assert residuals(QP_ALL, *parts).worst_scaled > 0.5


def test_a_row_of_zeros() -> None:
    possible = QP(H=np.eye(1), g=[0], C=[[0]], l=[0], u=[0])
    assert residuals(possible, vec(0), NONE, vec(0), vec(0)).worst_scaled == 0
    impossible = QP(H=np.eye(1), g=[0], C=[[0]], l=[1], u=[2])
    assert residuals(impossible, vec(0), NONE, vec(0), vec(0)).primal_scaled == 1
    rounding = QP(H=np.eye(1), g=[0], C=[[0]], u=[-7e-18])
    assert residuals(rounding, vec(0), NONE, vec(0), vec(0)).worst_scaled < 1e-16


def test_zero_cost_is_no_division_by_zero() -> None:
    qp = QP(H=[[0]], g=[0])
    assert residuals(qp, vec(3), NONE, NONE, vec(0)).worst_scaled == 0


def test_primal_infeasibility_certificates() -> None:
    qp = QP(H=np.eye(2), g=[0, 0], A=[[1, 1]], b=[5], lb=[-1, -1], ub=[1, 1])
    for scale in (1.0, 1e-6, 1e6):
        assert is_primal_infeasibility_certificate(qp, vec(-scale), NONE, vec(scale, scale))
    assert not is_primal_infeasibility_certificate(qp, vec(1), NONE, vec(-1, -1)), "the opposite proves nothing"
    assert not is_primal_infeasibility_certificate(qp, vec(-1), NONE, vec(1, 0.9)), "must add up to zero"
    assert not is_primal_infeasibility_certificate(qp, vec(0), NONE, vec(0, 0))
    assert not is_primal_infeasibility_certificate(qp, vec(np.nan), NONE, vec(1, 1))
    open_box = QP(H=np.eye(2), g=[0, 0], A=[[1, 1]], b=[5], lb=[-1, -1])
    assert not is_primal_infeasibility_certificate(open_box, vec(-1), NONE, vec(1, 1)), "no upper side to push on"


def test_dual_infeasibility_certificates() -> None:
    qp = QP(H=np.diag([1, 0, 0]), g=[0, -1, 0], A=[[0, 0, 1]], b=[0], C=[[1, 1, 0]], l=[-1], lb=[-INF, 0, -1])
    for scale in (1e-6, 1.0, 1e6):
        assert is_dual_infeasibility_certificate(qp, vec(0, scale, 0))
    for wrong in (vec(1, 1, 0), vec(0, -1, 0), vec(0, 1, 1), vec(0, 0, 0), vec(0, np.nan, 0)):
        assert not is_dual_infeasibility_certificate(qp, wrong)
    closed = QP(H=np.diag([1, 0]), g=[0, -1], ub=[INF, 9])
    assert not is_dual_infeasibility_certificate(closed, vec(0, 1))


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_a_ray_is_one_in_any_units(unit: float) -> None:
    """Two variables grow together without end, one of them in another unit."""
    qp = QP(H=np.zeros((2, 2)), g=[-1, 0], A=[[1, -unit]], b=[0], lb=[0, 0])
    assert is_dual_infeasibility_certificate(qp, vec(1, 1 / unit))
    assert not is_dual_infeasibility_certificate(qp, vec(-1, -1 / unit))
    assert not is_dual_infeasibility_certificate(qp, vec(1, 2 / unit))
