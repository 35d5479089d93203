"""The library's own solver as a backend: warm starts, statuses, memory."""

import numpy as np
import pytest

from kinqp.solvers import QP, OptionError, Status, get_solver, solve
from kinqp.solvers.active_set import ActiveSet, fixed_size_sources, sources
from kinqp.solvers.catalogue import CATALOGUE, KnownQP
from tests.solvers.random_problems import draw

SOLVABLE = [known for known in CATALOGUE if known.status is Status.SOLVED]


def test_it_is_the_default() -> None:
    qp = SOLVABLE[0].qp
    assert solve(qp).x.tobytes() == get_solver("active-set").solve(qp).x.tobytes()


@pytest.mark.parametrize("known", SOLVABLE, ids=lambda known: known.name)
def test_answers_are_exact_up_to_rounding(known: KnownQP) -> None:
    """No interior-point tolerance: the catalogue's `accuracy` is not needed."""
    solution = get_solver("active-set").solve(known.qp)
    assert solution.residuals.worst_scaled <= 1e-14
    if known.x_unique:
        np.testing.assert_allclose(solution.x, known.x, rtol=1e-11, atol=1e-12)
    if known.dual_unique:
        np.testing.assert_allclose(solution.z, known.z, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("known", SOLVABLE, ids=lambda known: known.name)
def test_warm_start_from_the_answer_takes_no_step(known: KnownQP) -> None:
    solver = get_solver("active-set", warm=True)
    first, again = solver.solve(known.qp), solver.solve(known.qp)
    assert again.solved
    assert again.iterations == 0
    np.testing.assert_allclose(again.x, first.x, rtol=1e-10, atol=1e-12)
    solver.reset()
    assert solver.solve(known.qp).x.tobytes() == first.x.tobytes(), "reset forgets the active set"


def test_warm_and_cold_agree_along_a_path() -> None:
    rng = np.random.default_rng(5)
    C, g = rng.normal(size=(12, 6)), rng.normal(size=6)
    steps = {"warm": 0, "cold": 0}
    warm, cold = get_solver("active-set(warm=true)"), get_solver("active-set")
    for _ in range(200):
        C, g = C + 0.01 * rng.normal(size=C.shape), g + 0.2 * rng.normal(size=6)
        qp = QP(H=np.eye(6), g=g, C=C, l=np.full(12, -0.5), u=np.full(12, 0.5), lb=np.full(6, -0.4))
        one, two = warm.solve(qp), cold.solve(qp)
        assert one.solved
        assert two.solved
        np.testing.assert_allclose(one.x, two.x, atol=1e-12)
        steps["warm"] += one.iterations
        steps["cold"] += two.iterations
    assert steps["warm"] < 0.5 * steps["cold"]


@pytest.mark.parametrize(("given", "meant"), [(True, True), (1, True), ("True", True), (0, False), ("false", False)])
def test_warm_is_true_or_false(given: object, meant: bool) -> None:
    solver = get_solver("active-set", warm=given)
    assert isinstance(solver, ActiveSet)
    assert solver.warm is meant
    with pytest.raises(OptionError, match="warm must be true or false, but is 'perhaps'"):
        get_solver("active-set", warm="perhaps")


def test_cap_is_kept_and_said() -> None:
    qp = QP(H=np.eye(2), g=[-5, -6], ub=[1, 2])
    solution = get_solver("active-set", max_iterations=1).solve(qp)
    assert solution.status is Status.MAX_ITERATIONS
    assert solution.iterations == 1
    assert "within 1 iterations" in solution.message


def test_numbers_of_numpy_are_options() -> None:
    solver = get_solver("active-set", max_iterations=np.int64(5), tolerance=np.float32(1e-8))
    assert isinstance(solver, ActiveSet)
    assert (solver.max_iterations, type(solver.max_iterations)) == (5, int)
    assert solver.tolerance == pytest.approx(1e-8)
    for wrong in (np.int64(0), np.float64(5), np.bool_(True)):
        with pytest.raises(OptionError, match="max_iterations must be an integer of at least 1"):
            get_solver("active-set", max_iterations=wrong)


def test_bounds_that_cross_by_rounding_are_one() -> None:
    """Also where nobody checked them: `QP` sets them to their middle, `QP.trusted` does not."""
    above = np.array([np.nextafter(0.3, 1)])
    for field in ({"lb": above, "ub": np.array([0.3])}, {"C": np.eye(1), "l": above, "u": np.array([0.3])}):
        solution = solve(QP.trusted(H=np.eye(1), g=np.zeros(1), **field))
        assert solution.solved
        assert solution.x[0] == pytest.approx(0.3, abs=1e-15)


def test_crossed_bounds_are_infeasible_without_a_certificate() -> None:
    for field in ({"lb": np.array([1.0, 0]), "ub": np.zeros(2)}, {"C": np.eye(2), "l": np.ones(2), "u": np.zeros(2)}):
        solution = solve(QP.trusted(H=np.eye(2), g=np.zeros(2), **field))
        assert solution.status is Status.PRIMAL_INFEASIBLE
        assert solution.certificate is None
        assert solution.message == "A lower bound lies above its upper bound."


@pytest.mark.parametrize(
    "H", [np.diag([1.0, -1]), np.array([[0.0, 1], [1, 0]]), np.array([[1.0, 1], [0, 1]]), np.diag([1, np.inf])]
)
def test_what_is_no_convex_problem_fails(H: np.ndarray) -> None:
    solution = solve(QP.trusted(H=H, g=np.zeros(2)))
    assert solution.status is Status.FAILED
    assert "not convex" in solution.message
    assert np.isnan(solution.x).all(), "zeros could be taken for a command"


def test_sizes_may_change_at_every_call() -> None:
    rng = np.random.default_rng(8)
    problems = [draw(rng, largest=12).qp for _ in range(60)]
    solver = get_solver("active-set")
    for qp in [*problems, *reversed(problems)]:
        assert solver.solve(qp).x.tobytes() == get_solver("active-set").solve(qp).x.tobytes()


def test_sources_are_complete_and_portable() -> None:
    everything, fixed = sources(), fixed_size_sources()
    assert sorted(fixed) == sorted(
        [
            "kinqp_as.h",
            "kinqp_as_core.inc",
            "kinqp_as_factor.inc",
            "kinqp_as_fixed.h",
            "kinqp_as_steps.inc",
            "kinqp_status.h",
        ]
    )
    for name, text in (everything | fixed).items():
        assert text.isascii(), name
        assert "//" not in text, name
        assert len(text.splitlines()) < 300, name
