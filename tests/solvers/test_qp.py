"""The QP: what it refuses, and what it stores."""

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import sparse

from kinqp.solvers import QP, QPError

NAN, INF = np.nan, np.inf
GOOD: dict[str, Any] = {
    "H": [[2, 1], [1, 2]],
    "g": [1, 2],
    "A": [[1, 1]],
    "b": [0],
    "C": [[1, 0], [0, 1], [1, -1]],
    "l": [-1, -INF, 0],
    "u": [1, 1, INF],
    "lb": [-5, -INF],
    "ub": [INF, 5],
    "x_feasible": [0, 0],
}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"H": [1, 2]}, r"H must be square .* shape \(2,\)"),
        ({"H": [[1, 2, 3], [1, 2, 3]]}, r"H must be square .* shape \(2, 3\)"),
        ({"H": np.empty((0, 0))}, "H must be square with at least one row"),
        ({"H": [[1, 2], [1]]}, "H must be an array of real numbers"),
        ({"H": "two"}, "H must be an array of real numbers"),
        ({"H": [[1, 0], [0, 1j]]}, "H must be an array of real numbers, but holds complex"),
        ({"H": [[1, NAN], [NAN, 1]]}, r"H must be finite, but H\[0, 1\] is nan"),
        ({"H": [[1, 0.1], [0, 1]]}, "H must be symmetric"),
        ({"H": [[1, 2], [2, 1]]}, "H must be positive semi-definite, but its smallest eigenvalue is -1"),
        ({"H": 1e-9 * np.array([[1, 2], [2, 1]])}, "H must be positive semi-definite"),
        ({"g": [1]}, r"g must have shape \(2,\), the number of variables, but has shape \(1,\)"),
        ({"g": [[1, 2]]}, "g must have shape"),
        ({"g": [1, INF]}, r"g must be finite, but g\[1\] is inf"),
        ({"g": [NAN, 0]}, r"g must be finite, but g\[0\] is nan"),
        ({"A": [[1, 1, 1]]}, r"A must have shape \(rows, 2\)"),
        ({"A": [[1, NAN]]}, r"A must be finite, but A\[0, 1\] is nan"),
        ({"A": None}, "b was given without A"),
        ({"b": None}, "A was given without b"),
        ({"b": [1, 2]}, r"b must have shape \(1,\), the number of rows of A"),
        ({"b": [INF]}, "b must be finite"),
        ({"C": [1, 0]}, "C must have shape"),
        ({"C": [[INF, 0], [0, 1], [1, -1]]}, "C must be finite"),
        ({"C": None}, "l or u was given without C"),
        ({"l": [-1, 0]}, r"l must have shape \(3,\)"),
        ({"l": [-1, NAN, 0]}, r"l must hold numbers or -inf, but l\[1\] is nan"),
        ({"l": [-1, INF, 0]}, r"l must hold numbers or -inf, but l\[1\] is inf"),
        ({"u": [1, -INF, 1]}, r"u must hold numbers or inf, but u\[1\] is -inf"),
        ({"u": [-2, 1, 1]}, r"l must not exceed u, but l\[0\] = -1.0 > -2.0"),
        ({"lb": [0]}, r"lb must have shape \(2,\)"),
        ({"lb": [INF, 0]}, "lb must hold numbers or -inf"),
        ({"ub": [NAN, 0]}, "ub must hold numbers or inf"),
        ({"ub": [-6, 5]}, "lb must not exceed ub"),
        ({"x_feasible": [0]}, "x_feasible must have shape"),
        ({"x_feasible": [NAN, 0]}, "x_feasible must be finite"),
    ],
)
def test_every_defect_is_refused_in_one_sentence(change: dict[str, Any], message: str) -> None:
    with pytest.raises(QPError, match=message) as caught:
        QP(**(GOOD | change))
    text = str(caught.value)
    assert text.endswith(".")
    assert "\n" not in text


@pytest.mark.parametrize("field", ["H", "A", "C"])
def test_sparse_matrices_are_refused_with_the_remedy(field: str) -> None:
    with pytest.raises(
        QPError, match=rf"{field} must be a dense array, but is a sparse csc_matrix: give {field}.toarray"
    ):
        QP(**(GOOD | {field: sparse.csc_matrix(np.array(GOOD[field], dtype=float))}))


def test_empty_lists_have_no_rows() -> None:
    for fields in ({"A": []}, {"A": [], "b": []}, {"C": []}, {"C": [], "l": [], "u": []}):
        qp = QP(H=np.eye(2), g=[0, 0], **fields)
        assert qp.A.shape == qp.C.shape == (0, 2)


def test_single_precision_is_allowed_its_rounding() -> None:
    """A Gram matrix of rank 3 in float32: neither symmetric nor semidefinite to double precision."""
    root = np.random.default_rng(2).normal(size=(3, 6)).astype(np.float32)
    gram = root.T @ root
    gram[0, 1] *= np.float32(1 + 3e-7)
    qp = QP(H=gram, g=np.zeros(6))
    np.testing.assert_array_equal(qp.H, qp.H.T)
    assert np.linalg.eigvalsh(qp.H)[0] > -1e-14
    np.testing.assert_allclose(qp.H, gram, atol=1e-5)
    with pytest.raises(QPError, match="if it was computed in single precision, give it as float32"):
        QP(H=gram.astype(float), g=np.zeros(6))


def test_bounds_that_cross_by_rounding_become_one() -> None:
    above = np.nextafter(0.3, 1)
    qp = QP(H=np.eye(1), g=[1], C=[[1]], l=[above], u=[0.3], lb=[above], ub=[0.3])
    assert qp.l == qp.u
    assert qp.lb == qp.ub
    with pytest.raises(QPError, match="lb must not exceed ub"):
        QP(H=np.eye(1), g=[1], lb=[0.3 + 1e-9], ub=[0.3])


def test_error_is_a_value_error() -> None:
    assert issubclass(QPError, ValueError)


def test_rounding_in_H_is_accepted_and_removed() -> None:
    H = np.array([[1.0, 1.0], [1.0, 1.0]])
    H[0, 1] += 1e-15
    qp = QP(H=H, g=[0, 0])
    np.testing.assert_array_equal(qp.H, qp.H.T)


@pytest.mark.parametrize("trusted", [False, True])
def test_arrays_are_copied_read_only_and_contiguous(trusted: bool) -> None:
    given = {name: np.array(value, dtype=float, order="F") for name, value in GOOD.items()}
    qp = QP.trusted(**given) if trusted else QP(**given)
    for name, value in given.items():
        mine = getattr(qp, name)
        np.testing.assert_array_equal(mine, value)
        assert mine.dtype == np.float64
        assert mine.flags.c_contiguous
        assert not mine.flags.writeable
        assert value.flags.writeable
        value[...] = 99
        assert not (mine == 99).any()
    with pytest.raises(AttributeError):
        qp.g = given["g"]  # type: ignore[misc]  # that is the point


def test_stacked_form_agrees_with_the_fields() -> None:
    qp = QP(**GOOD)
    assert (qp.n, qp.m_eq, qp.m_ineq) == (2, 1, 3)
    np.testing.assert_array_equal(qp.stacked, np.vstack((qp.A, qp.C, np.eye(2))))
    np.testing.assert_array_equal(qp.lower, np.concatenate((qp.b, qp.l, qp.lb)))
    np.testing.assert_array_equal(qp.upper, np.concatenate((qp.b, qp.u, qp.ub)))
    assert repr(qp) == "QP(n=2, m_eq=1, m_ineq=3)"


def test_absent_parts_are_empty_or_infinite() -> None:
    for qp in (QP(H=np.eye(2), g=[0, 0]), QP.trusted(H=np.eye(2), g=np.zeros(2))):
        assert qp.A.shape == qp.C.shape == (0, 2)
        assert qp.b.shape == qp.l.shape == qp.u.shape == (0,)
        assert (qp.lb == -INF).all()
        assert (qp.ub == INF).all()
        assert qp.x_feasible is None
    rows = QP(H=np.eye(2), g=[0, 0], C=[[1, 1]])
    assert rows.l[0] == -INF
    assert rows.u[0] == INF


def test_structure_sees_sides_not_values() -> None:
    base = QP(**GOOD)
    assert QP(**(GOOD | {"l": [-2, -INF, -3], "g": [5, 5]})).structure == base.structure
    assert QP(**(GOOD | {"l": [-1, -7, 0]})).structure != base.structure
    assert QP(**(GOOD | {"l": [1, -INF, 0]})).structure != base.structure
    assert QP(**(GOOD | {"A": None, "b": None})).structure != base.structure


def test_objective() -> None:
    assert QP(**GOOD).objective(np.array([1.0, 2.0])) == pytest.approx(0.5 * (2 + 4 + 8) + 5)


def test_save_and_load_for_replay(tmp_path: Path) -> None:
    qp = QP(**GOOD)
    path = tmp_path / "problem.qp"
    qp.save(path)
    for again in (QP.load(path), pickle.loads(pickle.dumps(qp))):  # noqa: S301 - our own bytes
        for name in GOOD:
            np.testing.assert_array_equal(getattr(again, name), getattr(qp, name))
    np.savez(tmp_path / "part.npz", H=np.eye(2))
    with pytest.raises(QPError, match="g, A, b, C, l, u, lb, ub is missing"):
        QP.load(tmp_path / "part.npz")


def test_a_defective_qp_can_be_replayed(tmp_path: Path) -> None:
    QP.trusted(H=np.eye(1), g=np.array([NAN])).save(tmp_path / "bad.npz")
    with pytest.raises(QPError, match="g must be finite"):
        QP.load(tmp_path / "bad.npz")
    again = QP.load(tmp_path / "bad.npz", trusted=True)
    assert np.isnan(again.g[0])
    assert again.x_feasible is None
