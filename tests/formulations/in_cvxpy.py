"""Problems written in cvxpy, their Parameters called after quantities of the tick."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cvxpy as cp
import numpy as np
from cvxpy.atoms.affine.binary_operators import multiply
from cvxpy.atoms.affine.sum import sum as total
from cvxpy.atoms.elementwise.huber import huber
from cvxpy.atoms.max import max as largest
from cvxpy.atoms.norm1 import norm1
from cvxpy.atoms.quad_form import quad_form
from cvxpy.atoms.sum_squares import sum_squares

from kinqp.formulations import DEFAULT_JOINT_WEIGHT, Formulation

if TYPE_CHECKING:
    from collections.abc import Callable

NV = 7
M_FREE = M_FIXED = 3


def parameter(name: str, *shape: int, **attributes: Any) -> Any:
    return cp.Parameter(shape, name=name, **attributes)


def joint_space(nv: int = NV, m_free: int = M_FREE, m_fixed: int = M_FIXED) -> Formulation:
    """`joint-space`, term by term as declared there."""
    weight = parameter("joint_weight", nv, nonneg=True, value=np.full(nv, DEFAULT_JOINT_WEIGHT))
    task_weight = parameter("task_weight", m_free, nonneg=True, value=np.ones(m_free))
    eps, qd = cp.Variable(m_free, name="eps"), cp.Variable(nv, name="qd")
    v = parameter("v", m_free)
    rows = [(parameter("J_free", m_free, nv) @ qd - eps == v).set_label("task")]
    if m_fixed:
        rows.append((parameter("J_fixed", m_fixed, nv) @ qd == parameter("v_fixed", m_fixed)).set_label("mode"))
    rows.append((parameter("qd_lo", nv) <= qd).set_label("joint limits"))
    rows.append((qd <= parameter("qd_hi", nv)).set_label("joint limits"))
    cost = 0.5 * total(multiply(task_weight, cp.square(eps))) + 0.5 * total(multiply(weight, cp.square(qd)))
    standing = {"eps": -v, "qd": np.zeros(nv)}
    return Formulation.from_cvxpy(
        cp.Problem(cp.Minimize(cost), rows), command=qd, name="joint-space-in-cvxpy", feasible=standing
    )


def unnamed() -> Formulation:
    """Nothing has a name but what must; the residual stands in the objective instead of a row."""
    J_free, v, root = parameter("J_free", 3, NV), parameter("v", 3), parameter("root", nonneg=True, value=1e-2)
    qd = cp.Variable(NV)
    rows = [parameter("J_fixed", 3, NV) @ qd == 0, qd <= parameter("qd_hi", NV), parameter("qd_lo", NV) <= qd]
    cost = 0.5 * sum_squares(J_free @ qd - v) + 0.5 * sum_squares(root * qd)
    return Formulation.from_cvxpy(cp.Problem(cp.Minimize(cost), rows), command=qd, name="unnamed")


def problem(kind: str) -> tuple[cp.Problem, Any]:
    """One of `KINDS` on the task, the locked rows and the joint limits; with it, the command."""
    J_free, v, w = parameter("J_free", 3, NV), parameter("v", 3), parameter("w", nonneg=True, value=1e-3)
    previous, qd = parameter("qd_prev", NV), cp.Variable(NV, name="qd")
    task = 0.5 * sum_squares(J_free @ qd - v)
    rows = [parameter("J_fixed", 3, NV) @ qd == 0, qd <= parameter("qd_hi", NV), qd >= parameter("qd_lo", NV)]
    command: Any = qd
    if kind == "scale":
        s = cp.Variable(name="s", bounds=[0, 1])
        rows.append(J_free @ qd == v * s)
        cost = 1e-3 * sum_squares(qd) + cp.square(1 - s)
    elif kind == "shifted":  # the variable is half of what is added to the least motion of the locked rows
        command = 2 * qd + parameter("qd_fixed", NV)
        rows = [rows[0], command <= rows[1].args[1], command >= rows[2].args[0]]
        cost = 0.5 * sum_squares(2 * J_free @ qd - v) + w * sum_squares(qd)
    else:
        cost = task + COSTS[kind](qd, w, previous)
    if kind == "maximise":
        return cp.Problem(cp.Maximize(2.0 - cost), rows), command
    return cp.Problem(cp.Minimize(cost), rows), command


_SQUARE = np.eye(NV) + 0.5 * np.eye(NV, k=1) + 0.5 * np.eye(NV, k=-1)
COSTS: dict[str, Callable[[Any, Any, Any], Any]] = {
    "form": lambda qd, w, _: w * quad_form(qd, _SQUARE) + quad_form(qd, 1e-3 * np.diag(np.arange(1.0, NV + 1))),
    "inertia": lambda qd, _, __: 1e-3 * sum_squares(parameter("M", NV, NV, PSD=True) @ qd),
    "diagonal": lambda qd, _, __: sum_squares(
        parameter("D", NV, NV, diag=True, value=0.05 * np.diag(np.arange(1.0, 8.0))) @ qd
    ),
    "linear": lambda qd, w, previous: 1e-2 * sum_squares(qd) - 1e-2 * previous @ qd + w,
    "maximise": lambda qd, w, _: w * sum_squares(qd),
    "memory": lambda qd, w, previous: w * sum_squares(qd) + 0.1 * sum_squares(qd - previous),
    "norm": lambda qd, w, _: w * norm1(qd) + 1e-4 * sum_squares(qd),
    "largest": lambda qd, w, _: w * largest(cp.abs(qd)) + 1e-4 * sum_squares(qd),
    "huber": lambda qd, _, __: total(huber(qd, 0.1)) * 1e-2 + 1e-3 * sum_squares(qd),
}
DEFINITE = ("form", "inertia", "diagonal", "linear", "maximise", "memory", "scale", "shifted")
FLAT = ("norm", "largest", "huber")
