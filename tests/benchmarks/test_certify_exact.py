"""Exact arithmetic of the proofs: integers that are the doubles, and which conditions can hold together."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from kinqp.benchmarks.certify import Condition, Decider
from kinqp.benchmarks.certify.cone import _simplex
from kinqp.benchmarks.certify.exact import adjugate, combined, integers, null_vector, reciprocal_lengths


def _rows(size: int, largest: int, *, least: int, most: int) -> st.SearchStrategy[list[list[int]]]:
    row = st.lists(st.integers(-largest, largest), min_size=size, max_size=size)
    return st.lists(row, min_size=least, max_size=most)


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=6))
def test_integers_are_the_doubles_themselves(values: list[float]) -> None:
    whole, exponent = integers(np.array(values))
    assert [Fraction(n, 1) / Fraction(2) ** exponent for n in whole.tolist()] == [Fraction(x) for x in values]


@given(
    st.integers(1, 6).flatmap(
        lambda k: st.lists(st.lists(st.integers(-99, 99), min_size=k, max_size=k), min_size=k, max_size=k)
    )
)
def test_adjugate_times_matrix_is_the_determinant(matrix: list[list[int]]) -> None:
    inverse, determinant = adjugate(matrix)
    size = len(matrix)
    product = np.array(inverse, dtype=object) @ np.array(matrix, dtype=object)
    assert (product == determinant * np.eye(size, dtype=int)).all()
    assert determinant == int(sympy.Matrix(matrix).det())


@given(
    st.integers(1, 4).flatmap(
        lambda d: st.lists(st.lists(st.integers(-9, 9), min_size=d, max_size=d), min_size=1, max_size=d + 1)
    )
)
def test_null_vector_is_found_where_there_is_just_one(columns: list[list[int]]) -> None:
    weights = null_vector(columns)
    rank = np.linalg.matrix_rank(np.array(columns, dtype=float))
    assert (weights is None) == (rank != len(columns) - 1)
    if weights is not None:
        assert any(weights)
        assert not any(combined(weights, columns))


def test_reciprocal_lengths_are_longer_than_doubles() -> None:
    one, root, none = reciprocal_lengths([1, 2, 0])
    assert none == 0
    assert abs(Fraction(one**2, root**2) - 2) < Fraction(1, 10**34)


def _conditions(rows: list[list[int]], strict: list[bool]) -> list[Condition]:
    return [Condition.of(tuple(row), strict=is_strict) for row, is_strict in zip(rows, strict, strict=False)]


@settings(max_examples=80, deadline=None)
@given(
    st.integers(1, 4).flatmap(lambda d: _rows(d, 3, least=1, most=9)), st.lists(st.booleans(), min_size=9, max_size=9)
)
def test_conditions_hold_together_as_a_linear_program_says(given_rows: list[list[int]], strict: list[bool]) -> None:
    rows = list(zip(given_rows, strict, strict=False))
    conditions = _conditions(given_rows, strict)
    # Small integers: the program's optimum is 0 or far from it.
    matrix = np.array([[*row, float(is_strict)] for row, is_strict in rows], dtype=float)
    matrix[:, :-1] *= -1.0
    size = matrix.shape[1] - 1
    cost = np.append(np.zeros(size), -1.0)
    best = -linprog(cost, A_ub=matrix, b_ub=np.zeros(len(rows)), bounds=[(-1e3, 1e3)] * size + [(0.0, 1.0)]).fun
    expected = best > 0.5 or not any(is_strict for _, is_strict in rows)
    for theta in (Decider().witness((), conditions), _simplex(conditions)[0]):
        assert (theta is not None) == expected
        assert theta is None or all(condition.holds(theta) for condition in conditions)


def test_an_edge_that_floating_point_cannot_see_is_decided() -> None:
    # x > 0 and y >= x and y <= x (1 + 2^-200): thinner than any double, but there.
    tiny = 1 << 200
    there = _conditions([[1, 0], [-1, 1], [tiny + 1, -tiny]], [True, False, False])
    assert Decider().witness((), there) is not None
    not_there = _conditions([[1, 0], [-1, 1], [tiny - 1, -tiny]], [True, False, False])
    assert Decider().witness((), not_there) is None
    decider = Decider()
    assert decider.witness((), not_there) is None
    assert decider.witness((), not_there) is None
    assert decider.tally.again == 1  # known from before
