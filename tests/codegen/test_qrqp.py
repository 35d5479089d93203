"""CasADi's generated solver inside the tick: the same commands where it finds an answer, the safe stop where not."""

import numpy as np
import pytest

from kinqp.codegen import compile_step
from kinqp.codegen.qrqp import render_qrqp
from kinqp.formulations import InputError, Mode, get_formulation
from kinqp.solvers import Status
from tests.codegen.compiled import FORMULATIONS, code, compiled, near
from tests.robots.arms import arm


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("mode", ["fix-orientation", "free"])
def test_it_gives_the_commands_of_our_own(formulation: str, mode: str) -> None:
    robot, rng = arm("lbr_med14"), np.random.default_rng(5)
    step = compile_step(robot, formulation, mode, solver="casadi-qrqp")
    count = 300
    Q = np.array([near(robot.q_min, robot.q_max, rng) for _ in range(count)])
    V = 0.3 * rng.normal(size=(count, step.mode.m_free))
    mine, theirs = compiled("lbr_med14", formulation, mode).batch(Q, V), step.batch(Q, V)
    both = (mine.codes == 0) & (theirs.codes == 0)
    assert both.mean() > 0.8
    np.testing.assert_allclose(theirs.qd[both], mine.qd[both], rtol=0, atol=1e-6)
    assert not theirs.qd[theirs.codes != 0].any()
    assert (theirs.iterations == -1).all()
    held = both & (np.abs(mine.sides).sum(axis=1) == 1)
    assert held.sum() > 10
    assert (theirs.sides[held] == mine.sides[held]).mean() > 0.99


def test_inputs_reach_it_and_what_is_not_finite_is_refused() -> None:
    step = compile_step(arm("lbr_med14"), "joint-space", "fix-orientation", solver="casadi-qrqp")
    q, v = np.deg2rad([10.0, 30.0, 5.0, -60.0, -5.0, 60.0, 0.0]), np.array([0.1, 0.0, 0.0])
    usual = compiled("lbr_med14", "joint-space", "fix-orientation")
    for options in ({"qd_max": np.full(7, 0.02)}, {"dt": 0.002}, {"joint_weight": 0.1}, {"v_fixed": [1e-3, 0.0, 0.0]}):
        mine, theirs = usual(q, v, **options), step(q, v, **options)
        assert mine.status is theirs.status is Status.SOLVED
        np.testing.assert_allclose(theirs.qd, mine.qd, rtol=0, atol=1e-8)
        np.testing.assert_allclose(theirs.eps, mine.eps, rtol=0, atol=1e-8)
    with pytest.raises(InputError, match=r"^q: expected finite numbers"):
        step(np.full(7, np.nan), v)
    batch = step.batch(np.array([q, np.full(7, np.inf)]), np.array([v, v]))
    assert batch.status == (Status.SOLVED, Status.FAILED)


def test_the_source_allocates_nothing() -> None:
    case = ("lbr_med14", "cartesian-error", "fix-orientation")
    files = render_qrqp(code(*case), get_formulation(case[1]), arm(case[0]), Mode.parse(case[2]))
    assert set(files) == {f"{code(*case).prefix}.h", f"{code(*case).prefix}.c", "qrqp.c"}
    assert not any(word in text for text in files.values() for word in ("malloc", "calloc", "free("))


@pytest.mark.parametrize("options", [{"feasible": True}, {"max_iterations": 5}])
def test_options_that_it_has_not_are_refused(options: dict[str, int]) -> None:
    with pytest.raises(ValueError, match=r"^feasible, max_iterations: expected neither with casadi-qrqp"):
        compile_step(arm("lbr_med14"), "joint-space", "free", solver="casadi-qrqp", **options)  # type: ignore[arg-type]  # one dict of both kinds
