"""The robust formulations against finite differences, linear programs and the formulations they come from."""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
import pytest

from kinqp.formulations import JointSpaceRobust, Mode, Tick, get_formulation
from kinqp.formulations.singularity import damping, governor, pull
from kinqp.solvers import Status, solve
from tests.formulations.least import least
from tests.formulations.reference import MODES, adversarial_state, evaluator, null_projector, rows_at
from tests.robots.arms import arm

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

ROBUST = ("joint-space-robust", "cartesian-error-robust")
NOTHING = "damping=false, pull=false, rate_limit=false, smoothing=false, governor=false, jerk=false"
STRETCHED = np.deg2rad([10.0, 40.0, 5.0, 0.0, -5.0, 40.0, 0.0])


@functools.cache
def ingredients(robot: str, mode: str) -> Callable[..., tuple[Array, float, float]]:
    """Return (pull, governor, weakness) at (q, v, qd_prev)."""
    tick = Tick(arm(robot), Mode.parse(mode))
    measured = damping(tick)
    outputs = [ca.densify(pull(tick, measured)), governor(tick, measured)[0], measured.weakness]
    names = [given.name for given in tick.inputs]
    function = ca.Function("ingredients", [given.symbol for given in tick.inputs], outputs, names, ["p", "g", "w"])
    defaults = {given.name: given.default for given in tick.inputs if given.default is not None}

    def evaluate(q: Array, v: Array, qd_prev: Array | None = None) -> tuple[Array, float, float]:
        given = {"q": q, "v": v, "qd_prev": np.zeros(len(q)) if qd_prev is None else qd_prev}
        out = function(**(defaults | {name: value for name, value in given.items() if name in names}))
        return np.array(out["p"])[:, 0], float(out["g"]), float(out["w"])

    return evaluate


def j_bar(robot: str, mode: str, q: Array) -> tuple[Array, Array]:
    free, fixed = rows_at(arm(robot), Mode.parse(mode), q)
    N = null_projector(fixed)
    return free @ N, N


def weak_state(robot: str, mode: str, seed: int) -> Array | None:
    """Draw a state with one weak direction, well apart from the next, and locked rows of full rank."""
    rng, read = np.random.default_rng(seed), arm(robot)
    for _ in range(2000):
        q = read.random_configuration(rng)
        sigma = np.linalg.svd(j_bar(robot, mode, q)[0], compute_uv=False)
        _, fixed = rows_at(read, Mode.parse(mode), q)
        locked = np.linalg.svd(fixed, compute_uv=False)[-1] if fixed.size else 1.0
        # Within the damping threshold of 0.2, but twenty times what counts as lost, where the way is a compromise.
        if 0.08 < sigma[-1] < 0.16 and (len(sigma) == 1 or sigma[-2] > 3.0 * sigma[-1]) and locked > 0.2:
            return q
    return None


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("robot", ["lbr_med14", "ur5e", "panda"])
def test_pull_climbs_the_smallest_singular_value(robot: str, mode: str) -> None:
    """Against central differences of the singular value itself, null space and all."""
    compared = 0
    for seed in range(2):
        q = weak_state(robot, mode, seed)
        if q is None:
            continue
        J_bar, N = j_bar(robot, mode, q)
        u = np.linalg.svd(J_bar)[0][:, -1]
        h = 1e-6
        slope = np.array([
            (np.linalg.svd(j_bar(robot, mode, q + h * e)[0], compute_uv=False)[-1]
             - np.linalg.svd(j_bar(robot, mode, q - h * e)[0], compute_uv=False)[-1]) / (2.0 * h)
            for e in np.eye(len(q))
        ])  # fmt: skip
        uphill = N @ slope
        if np.linalg.norm(uphill) < 0.05:
            continue
        velocity, _, weakness = ingredients(robot, mode)(q, 0.2 * u)
        assert uphill @ velocity > 0.95 * np.linalg.norm(uphill) * np.linalg.norm(velocity)
        _, fixed = rows_at(arm(robot), Mode.parse(mode), q)
        np.testing.assert_allclose(fixed @ velocity, 0.0, atol=1e-12)
        # Twice as fast as the hand times the weakness; the same whichever way the hand pulls.
        assert 0.7 * 0.4 * weakness < np.linalg.norm(velocity) < 1.01 * 0.4 * weakness
        np.testing.assert_allclose(ingredients(robot, mode)(q, -0.2 * u)[0] @ uphill, velocity @ uphill, rtol=0.1)
        compared += 1
    assert compared or mode in ("free", "line:z", "fix-position", "plane:1,-2,0.5", "rcm:-0.12", "position")


@pytest.mark.parametrize(
    ("mode", "q"),
    [
        ("fix-orientation", np.zeros(7)),
        ("position", np.zeros(7)),
        ("free", np.zeros(7)),
        ("fix-orientation", STRETCHED),
        ("free", STRETCHED),
    ],
)
def test_pull_leads_out_of_the_singularity_itself(mode: str, q: Array) -> None:
    """Where the singular value has a kink and no gradient, and det(J J') none either."""
    J_bar, _ = j_bar("lbr_med14", mode, q)
    U, sigma, _ = np.linalg.svd(J_bar)
    assert sigma[-1] < 1e-12
    radial = np.zeros(len(U))
    radial[:3] = arm("lbr_med14").pose(q)[:3, 3] - arm("lbr_med14").pose(q)[:3, :3] @ [0, 0, 0.126] - [0, 0, 0.36]
    radial *= 0.1 / np.linalg.norm(radial)
    for v in (radial, -radial):
        velocity, _, weakness = ingredients("lbr_med14", mode)(q, v)
        assert weakness == pytest.approx(1.0)
        assert np.linalg.norm(velocity) > 0.02
        after = np.linalg.svd(j_bar("lbr_med14", mode, q + velocity)[0], compute_uv=False)[-1]
        assert after > 5e-4
    np.testing.assert_array_equal(velocity, ingredients("lbr_med14", mode)(q, -radial)[0])


def test_pull_is_finite_and_still_where_nothing_is_asked() -> None:
    for robot in ("lbr_med14", "ur5e", "panda"):
        rng = np.random.default_rng(3)
        for mode in MODES:
            m = Mode.parse(mode).m_free
            for q in (np.zeros(arm(robot).nv), *(adversarial_state(arm(robot), rng) for _ in range(10))):
                still, share, _ = ingredients(robot, mode)(q, np.zeros(m))
                assert np.abs(still).max() < 1e-7
                assert share == 1.0
                velocity, share, _ = ingredients(robot, mode)(q, rng.normal(size=m))
                assert np.isfinite(velocity).all()
                assert 0.0 < share <= 1.0


def test_side_once_chosen_is_kept_against_noise() -> None:
    """A few milliradians per second outweigh an encoder's noise on the other side of a stretched elbow."""
    v = np.array([0.0, 0.0, -0.1])
    evaluate = ingredients("lbr_med14", "position")
    q = np.zeros(7)
    way = evaluate(q, v)[0]
    moving = 0.01 * way / np.linalg.norm(way)
    for sign in (1.0, -1.0):
        qd_prev = sign * moving
        for noise in (1e-5, -1e-5):
            assert evaluate(q + noise * way / np.linalg.norm(way), v, qd_prev)[0] @ qd_prev > 0.0


@pytest.mark.parametrize(("robot", "mode"), [("ur5e", "line:z"), ("panda", "rcm:-0.12"), ("lbr_med14", "fix-position")])
def test_governor_leaves_enough_acceleration(robot: str, mode: str) -> None:
    rng, read = np.random.default_rng(4), Mode.parse(mode)
    slowed = 0
    for _ in range(300):
        q = arm(robot).random_configuration(rng)
        v = 3.0 * rng.normal(size=read.m_free)
        J_bar, _ = j_bar(robot, mode, q)
        sigma = np.linalg.svd(J_bar, compute_uv=False)[-1]
        _, fixed = rows_at(arm(robot), read, q)
        if sigma < 0.32 or np.linalg.svd(fixed, compute_uv=False)[-1] < 0.02:
            continue
        share = ingredients(robot, mode)(q, v)[1]
        qd = share * np.linalg.pinv(J_bar) @ v
        h = 1e-5
        after, before = (rows_at(arm(robot), read, q + side * h * qd) for side in (1.0, -1.0))
        guided, locked = ((one - other) @ qd / (2.0 * h) for one, other in zip(after, before, strict=True))
        free, _ = rows_at(arm(robot), read, q)
        keep = np.linalg.pinv(fixed) @ locked
        shares = [
            np.abs(qdd / arm(robot).qdd_max).max() / most
            for qdd, most in ((keep, 0.3), (keep + np.linalg.pinv(J_bar) @ (guided - free @ keep), 1.0))
        ]
        assert max(shares) <= 1.0 + 1e-4
        if share < 1.0:
            assert max(shares) == pytest.approx(1.0, rel=1e-3)
            slowed += 1
    assert slowed > 5


@pytest.mark.parametrize(("robot", "mode"), [("ur5e", "line:z"), ("panda", "rcm:-0.12"), ("lbr_med14", "fix-position")])
def test_governor_brakes_an_arm_that_will_be_too_fast_for_its_locked_rows(robot: str, mode: str) -> None:
    """By finite differences of pinocchio's Jacobian, 60 ms ahead, at the arm's velocity; the hand asks for little."""
    rng, read = np.random.default_rng(8), Mode.parse(mode)
    slowed = 0
    for _ in range(60):
        q, qd = arm(robot).random_configuration(rng), rng.normal(size=arm(robot).nv)
        v = 1e-3 * rng.normal(size=read.m_free)
        h = 1e-5
        ahead = q + 0.06 * qd
        after, before = (rows_at(arm(robot), read, ahead + side * h * qd)[1] for side in (1.0, -1.0))
        _, fixed = rows_at(arm(robot), read, ahead)
        keep = np.linalg.pinv(fixed) @ ((after - before) @ qd / (2.0 * h))
        soon = np.abs(keep / arm(robot).qdd_max).max()
        still, share = (ingredients(robot, mode)(q, v, velocity)[1] for velocity in (0.0 * qd, qd))
        assert share == pytest.approx(min(still, (0.3 / soon) ** 1.5), rel=1e-5)
        slowed += share < still
    assert slowed > 5


@pytest.mark.parametrize("mode", MODES)
def test_without_its_parts_it_is_joint_space(mode: str) -> None:
    bare, plain = evaluator("panda", f"joint-space-robust({NOTHING})", mode), evaluator("panda", "joint-space", mode)
    rng = np.random.default_rng(5)
    for _ in range(4):
        q, v = adversarial_state(arm("panda"), rng), rng.normal(size=Mode.parse(mode).m_free)
        one, two = bare(q=q, v=v, joint_weight=1e-4), plain(q=q, v=v)
        for key in ("H", "g", "A", "b", "C", "l", "u", "lb", "ub", "x_feasible"):
            np.testing.assert_allclose(getattr(one.qp, key), getattr(two.qp, key), atol=1e-15, err_msg=key)


def test_away_from_all_limits_it_is_a_low_pass_of_joint_space() -> None:
    """The QP with smoothing alone: the command is the weighted mean of the last one and the plain one."""
    only = "joint-space-robust(damping=false, pull=false, rate_limit=false, governor=false, jerk=false)"
    smooth, plain = (
        evaluator("lbr_med14", only, "fix-orientation"),
        evaluator("lbr_med14", "joint-space", "fix-orientation"),
    )
    q, v = np.deg2rad([10.0, 30.0, 5.0, -60.0, -5.0, 60.0, 0.0]), np.array([0.02, 0.01, -0.03])
    wanted = solve(plain(q=q, v=v, joint_weight=1e-3).qp).x[3:]
    last = solve(plain(q=q, v=np.array([-0.01, 0.02, 0.0]), joint_weight=1e-3).qp).x[3:]
    qd = solve(smooth(q=q, v=v, qd_prev=last, smoothing_time=0.003).qp).x[3:]
    np.testing.assert_allclose(qd, 0.75 * last + 0.25 * wanted, atol=1e-12)


@pytest.mark.parametrize(
    "robot", ["lbr_med14", *(pytest.param(name, marks=pytest.mark.long) for name in ("ur5e", "panda"))]
)
@pytest.mark.parametrize("name", ROBUST)
@pytest.mark.parametrize("mode", MODES)
def test_declared_point_and_zero_motion_are_admissible(robot: str, name: str, mode: str) -> None:
    rng = np.random.default_rng(6)
    evaluate = evaluator(robot, name, mode)
    where = evaluate.lowered.variables
    for _ in range(25):
        q = adversarial_state(arm(robot), rng)
        v = rng.normal(size=Mode.parse(mode).m_free) * rng.choice([0.0, 0.2, 2.0])
        qd_prev = arm(robot).qd_max * rng.uniform(-1.5, 1.5, arm(robot).nv) * rng.choice([0.0, 0.01, 1.0])
        instance = evaluate(q=q, v=v, qd_prev=qd_prev)
        qp = instance.qp
        zero = qp.x_feasible.copy()
        if name == "joint-space-robust":
            zero[where["qd"]], zero[where["eps"]] = 0.0, -v
        np.testing.assert_allclose(instance.K @ zero + instance.k, 0.0, atol=1e-9)
        zero[where["excess"]] = np.max(np.abs(qd_prev) / (arm(robot).qdd_max * 1e-3)) + 1.0
        for x in (qp.x_feasible, zero):
            scale = 1e-9 * (1.0 + np.abs(x).max())
            np.testing.assert_allclose(qp.A @ x, qp.b, atol=scale)
            assert (qp.C @ x >= qp.l - scale).all()
            assert (qp.C @ x <= qp.u + scale).all()
            assert (x >= qp.lb - scale).all()
            assert (x <= qp.ub + scale).all()


@pytest.mark.parametrize("name", ROBUST)
def test_rate_limit_yields_no_more_than_it_must(name: str) -> None:
    """Against a linear program: the smallest excess with which locked rows, limits and window are compatible."""
    yielded = kept = 0
    for mode in ("fix-orientation", "line:z", "rcm:-0.12"):
        rng = np.random.default_rng(7)
        robot = arm("lbr_med14")
        evaluate = evaluator("lbr_med14", name, mode)
        column = evaluate.lowered.variables["excess"].start
        for _ in range(12):
            q = robot.random_configuration(rng)
            v = 0.2 * rng.normal(size=Mode.parse(mode).m_free)
            _, fixed = rows_at(robot, Mode.parse(mode), q)
            qd_prev = null_projector(fixed) @ rng.normal(size=7) * 0.3 + rng.choice([0.0, 0.05]) * rng.normal(size=7)
            qp = evaluate(q=q, v=v, qd_prev=qd_prev).qp
            solution = solve(qp)
            assert solution.status is Status.SOLVED
            lowest = least(qp, column)
            assert solution.x[column] == pytest.approx(lowest, abs=1e-6 * (1.0 + lowest))
            yielded += lowest > 1e-6
            kept += lowest < 1e-9
    assert yielded > 8
    assert kept > 8


def test_options() -> None:
    assert get_formulation("joint-space-robust(pull=false, bounds=thesis)") == JointSpaceRobust("thesis", pull=False)
    assert get_formulation("joint-space-robust") == JointSpaceRobust()
    with pytest.raises(ValueError, match=r"pull: expected damping, .* got damping=False"):
        JointSpaceRobust(damping=False)
    with pytest.raises(ValueError, match="governor must be true or false"):
        get_formulation("joint-space-robust(governor=fast)")
