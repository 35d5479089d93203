"""The formulations' ingredients once more, in NumPy and exact fractions, sharing no code with the library."""

from __future__ import annotations

import functools
from fractions import Fraction
from math import isqrt
from typing import TYPE_CHECKING

import numpy as np

from kinqp.formulations import (
    Evaluator,
    Formulation,
    Hierarchy,
    Mode,
    available_formulations,
    get_formulation,
    lower,
)
from tests.robots.arms import arm

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from kinqp.control import InterpretedStep
    from kinqp.robots import Robot

    Array = NDArray[np.float64]

# One of each of the seven, with arguments that are not axis-aligned.
MODES = (
    "free",
    "position",
    "fix-orientation",
    "fix-position",
    "line:z",
    "plane:1,-2,0.5",
    "rcm:-0.12",
)
DT = 1e-3
THRESHOLD, DAMPING_MAX = 0.08, 0.05


# Those that are one QP, not a cascade of several.
ONE_QP = tuple(name for name in available_formulations() if not isinstance(get_formulation(name), Hierarchy))
# Those among them whose command depends on its own tick alone.
MEMORYLESS = tuple(
    name for name in ONE_QP if get_formulation(name).safe_stop == "zero" and not name.endswith("-robust")
)


@functools.cache
def evaluator(robot: str, formulation: str | Formulation, mode: str) -> Evaluator:
    """Return an evaluator, lowered once per test run."""
    return Evaluator(lower(get_formulation(formulation), arm(robot), Mode.parse(mode)))


def last_command(evaluate: Evaluator, rng: np.random.Generator) -> dict[str, Array]:
    """Draw a last command for a formulation that takes one, small enough to be admissible inside the limits."""
    given = {spec.name: spec.size for spec in evaluate.inputs}
    return {"qd_prev": 0.1 * rng.normal(size=given["qd_prev"])} if "qd_prev" in given else {}


def needs_masses(formulation: str, robot: Robot) -> bool:
    """Whether a formulation is refused for the robot because its masses are unknown."""
    return formulation == "minimum-kinetic-energy" and not robot.has_inertia


def memory(step: Evaluator | InterpretedStep, qd_prev: Array) -> dict[str, Array]:
    """Give the last command to a step that takes it."""
    names = [given if isinstance(given, str) else given.name for given in step.inputs]
    return {"qd_prev": qd_prev} if "qd_prev" in names else {}


def skew(a: Array) -> Array:
    """Matrix with skew(a) @ b = a x b."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def rows_at(robot: Robot, mode: Mode, q: Array) -> tuple[Array, Array]:
    """Guided and locked rows from pinocchio's Jacobian: the velocity of the mode's point, along the mode's axes."""
    jacobian, rotation = robot.jacobian(q), robot.pose(q)[:3, :3]
    arm_of_lever = mode.depth * rotation[:, 2]
    linear = jacobian[:3] - skew(arm_of_lever) @ jacobian[3:]  # v + omega x r
    axes = np.array(mode.axes) if mode.frame == "world" else np.array(mode.axes) @ rotation.T
    rows = np.vstack((axes @ linear, axes @ jacobian[3:]))
    return rows[list(mode.free_rows)], rows[list(mode.fixed_rows)]


def null_projector(J_fixed: Array, relative: float = 1e-9) -> Array:
    """I - J_fixed^+ J_fixed by singular values."""
    nv = J_fixed.shape[1]
    if not J_fixed.size:
        return np.eye(nv)
    _, sigma, Vt = np.linalg.svd(J_fixed)
    kept = Vt[: int(np.sum(sigma > relative * sigma[0]))]
    return np.asarray(np.eye(nv) - kept.T @ kept)


def damped_inverse(J_bar: Array, threshold: float = THRESHOLD, damping_max: float = DAMPING_MAX) -> Array:
    """J_bar' (J_bar J_bar' + lambda^2 I)^-1 from singular values, with lambda as `robust_inverse` documents it."""
    U, sigma, Vt = np.linalg.svd(J_bar, full_matrices=False)
    with np.errstate(divide="ignore"):  # at a singularity the estimate is zero
        s2 = 1.0 / np.sqrt(np.sum(sigma**-4.0))
    damping = damping_max * max(1.0 - s2 / threshold**2, 0.0)
    return np.asarray(Vt.T @ np.diag(sigma / (sigma**2 + damping**2)) @ U.T)


def exact_viable_bound(distance: float, qd_max: float, qdd_max: float, dt: float) -> Fraction:
    """Largest v with v + (v - a) + (v - 2a) + ... <= d, counted in periods, in exact arithmetic.

    Since m(m+1)/2 is an integer, the largest m with m(m+1)/2 <= delta is that of floor(delta).
    """
    if distance <= 0.0:
        return Fraction(0)
    if distance == np.inf:
        return Fraction(qd_max)
    a, period = Fraction(qdd_max), Fraction(dt)
    delta = Fraction(distance) / (a * period**2)
    m = (isqrt(8 * int(delta) + 1) - 1) // 2
    theta = (delta - m * (m + 1) // 2) / (m + 1)
    return min(a * period * (m + theta), Fraction(qd_max))


def thesis_bound(distance: float, qd_max: float, qdd_max: float, dt: float) -> float:
    """Smallest of d/dt, qd_max and the continuous braking curve (A.1)."""
    d = max(distance, 0.0)
    return min(d / dt, qd_max, float(np.sqrt(2.0 * qdd_max * d)))


def bounds_at(robot: Robot, q: Array, name: str = "viable", dt: float = DT) -> tuple[Array, Array]:
    """Lower and upper joint velocity bounds."""
    bound = exact_viable_bound if name == "viable" else thesis_bound
    limits = list(zip(robot.q_min, q, robot.q_max, robot.qd_max, robot.qdd_max, strict=True))
    low = [-float(bound(x - least, speed, a, dt)) for least, x, _, speed, a in limits]
    high = [float(bound(most - x, speed, a, dt)) for _, x, most, speed, a in limits]
    return np.array(low), np.array(high)


def adversarial_state(robot: Robot, rng: np.random.Generator) -> Array:
    """Draw a state with every joint by chance inside, on a limit, a hair from it, or beyond it."""
    q = robot.random_configuration(rng)
    low = np.where(np.isfinite(robot.q_min), robot.q_min, -np.pi)
    high = np.where(np.isfinite(robot.q_max), robot.q_max, np.pi)
    near = np.where(rng.random(robot.nv) < 0.5, low, high)
    inwards = np.where(near == low, 1.0, -1.0)
    offset = rng.choice([0.0, 1e-17, 1e-9, 1e-5, 1e-3, -1e-9, -1e-2, -1.0], robot.nv)
    return np.asarray(np.where(rng.random(robot.nv) < 0.6, near + inwards * offset, q))
