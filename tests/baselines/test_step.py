"""What must hold of every baseline's command, behind the interface that formulations have."""

from collections import Counter

import numpy as np
import pytest

from kinqp.baselines import Baseline, BaselineStep, Resolved, available_baselines, get_baseline, is_baseline
from kinqp.control import BOUND_TOLERANCE, make_step, simulate
from kinqp.formulations import InputError, Mode, StepResult
from kinqp.solvers import PluginError, Status, UnknownOptionError
from tests.control.states import states
from tests.formulations.reference import MODES, bounds_at, memory, rows_at
from tests.robots.arms import arm

VARIANTS = (
    *available_baselines(),
    "task-priority(limits=none)",
    "task-priority(posture_gain=0.5)",
    "saturation-null-space(variant=optimal)",
    "saturation-null-space(posture_gain=0.5)",
    "saturation-null-space(variant=optimal,posture_gain=0.5)",
    "gradient-projection(criterion=joint-velocity)",
    "gradient-projection(criterion=manipulability)",
    "gradient-projection(criterion=obstacle-distance)",
    "geometric-scaling(bounds=thesis)",
)
SPEEDS = (1e-6, 0.01, 0.2, 2.0)
Q = np.deg2rad([10.0, 30.0, 5.0, -60.0, -5.0, 60.0, 0.0])
V = np.array([0.1, 0.0, -0.05])
ROBOT = arm("lbr_med14")


def extra(step: BaselineStep, rng: np.random.Generator) -> dict[str, np.ndarray]:
    return {"obstacle": rng.normal(size=3)} if "obstacle" in step.inputs else {}


@pytest.mark.parametrize("baseline", VARIANTS)
def test_promises_are_kept_and_all_else_is_reported(baseline: str) -> None:
    check(baseline, ("lbr_med14", "ur5e", "davinci5"), 6)


@pytest.mark.long
@pytest.mark.parametrize("baseline", VARIANTS)
def test_promises_are_kept_on_many_states(baseline: str) -> None:
    check(baseline, ("lbr_med14", "lbr_med7", "ur5e", "davinci5", "kinova", "mixed_to_side"), 60)


def check(baseline: str, robots: tuple[str, ...], count: int) -> None:
    promises, bounds = get_baseline(baseline).promises, get_baseline(baseline).bounds
    solved: Counter[bool] = Counter()
    for robot in map(arm, robots):
        for text in MODES:
            mode = Mode.parse(text)
            step = make_step(robot, baseline, mode)
            rng, before = np.random.default_rng(1), np.random.default_rng(2)
            for kind, q in states(robot, count):
                v = rng.normal(size=mode.m_free) * rng.choice(SPEEDS)
                qd_prev = robot.qd_max * before.uniform(-1.0, 1.0, robot.nv) * before.choice([0.0, 0.01, 1.0])
                result = step(q, v, **memory(step, qd_prev), **extra(step, before))
                case = f"{robot.name}, {text}, {kind}, q={q!r}, v={v!r}: {result.message}"
                solved[result.status is Status.SOLVED] += 1
                assert np.isfinite(result.qd).all(), case
                # Judged from the robot's own Jacobian and limits, not from what the step reports of itself.
                free, fixed = rows_at(robot, mode, q)
                np.testing.assert_allclose(
                    free @ result.qd - v, result.eps, rtol=1e-9, atol=1e-9 * (1.0 + np.abs(result.qd).max())
                )
                if result.status is not Status.SOLVED:
                    assert not result.qd.any(), case
                    assert result.message, case
                    continue
                check_promises(promises, result, fixed, bounds_at(robot, q, bounds), case)
    assert solved[True] >= 0.99 * solved.total(), solved


def check_promises(
    promises: frozenset[str],
    result: StepResult,
    fixed: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    case: str,
) -> None:
    excess = np.max(np.maximum(result.qd - bounds[1], bounds[0] - result.qd), initial=0.0)
    residual = np.abs(fixed @ result.qd)
    size = 1.0 + np.abs(result.qd).max()
    np.testing.assert_allclose(result.bound_violation, excess, rtol=1e-9, atol=1e-9 * size)
    np.testing.assert_allclose(result.fixed_error, np.max(residual, initial=0.0), rtol=1e-9, atol=1e-9 * size)
    if "joint bounds" in promises:
        assert excess <= BOUND_TOLERANCE + 1e-12, case
    if "locked rows" in promises:
        share = np.abs(fixed) @ np.abs(result.qd)
        assert (residual <= 2e-9 * np.maximum(share, 1.0)).all(), case
    exceeded = excess > 1.01 * BOUND_TOLERANCE or np.any(residual > 1e-7 * size)
    assert not exceeded or "as this method may" in result.message, case


def test_every_baseline_is_listed_and_carries_its_name() -> None:
    assert set(available_baselines()) >= {
        "geometric-clamping",
        "geometric-scaling",
        "gradient-projection",
        "null-space-compensation",
        "progressive-clamping",
        "saturation-null-space",
        "task-augmentation",
        "task-priority",
        "weighted-least-norm",
    }
    for name in available_baselines():
        assert get_baseline(name).name == name
        assert make_step(ROBOT, name, "fix-orientation").solver.name == "-"


@pytest.mark.parametrize("baseline", [name for name in VARIANTS if not name.startswith("task-augm")])
def test_an_easy_task_is_done_exactly_and_drift_corrected(baseline: str) -> None:
    """Away from all limits every method gives the hand what it asks for, and the locked rows what drift asks for."""
    drift = np.array([0.0, 0.01, -0.005])
    step = make_step(ROBOT, baseline, "fix-orientation")
    result = step(Q, 0.1 * V, v_fixed=drift, **memory(step, np.zeros(7)))
    assert result.status is Status.SOLVED
    assert result.message == ""
    np.testing.assert_allclose(result.eps, 0.0, atol=1e-12)
    np.testing.assert_allclose(ROBOT.jacobian(Q)[3:] @ result.qd, drift, atol=1e-12)


@pytest.mark.parametrize("baseline", VARIANTS)
def test_same_state_same_command_bit_for_bit_and_batch_is_one_after_the_other(baseline: str) -> None:
    step = make_step(ROBOT, baseline, Mode.fix_orientation())
    Qs, Vs = np.array([Q, Q + 0.3, Q]), np.array([V, 2.0 * V, V])
    last = memory(step, np.full(7, 0.1))
    first, second, again = step.batch(Qs, Vs, **last)
    assert first.qd.tobytes() == again.qd.tobytes()
    np.testing.assert_array_equal(second.qd, step(Qs[1], Vs[1], **last).qd)
    with pytest.raises(ValueError, match=r"Q and V: expected as many rows in both, got shapes \(3, 7\), \(2, 3\)"):
        step.batch(Qs, Vs[:2])


class Broken(Baseline):
    """Promises what it does not hold, or gives what is no number."""

    name = "broken"
    promises = frozenset({"joint bounds", "locked rows"})

    def __init__(self, qd: list[float]) -> None:
        super().__init__()
        object.__setattr__(self, "qd", np.array(qd))

    def ingredients(self, tick: object) -> dict[str, object]:  # noqa: ARG002  # nothing is asked of it
        return {}

    def resolve(self, at: object) -> Resolved:  # noqa: ARG002  # whatever the state
        return Resolved(self.qd)


@pytest.mark.parametrize(
    ("qd", "message"),
    [
        ([0.0, np.nan, 0.0, 0.0, 0.0, 0.0, 0.0], "the command is not finite"),
        ([9.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], "a joint exceeds its velocity bound"),
        ([0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], "a locked row is off"),
    ],
)
def test_a_broken_promise_stops_the_robot(qd: list[float], message: str) -> None:
    result = make_step(ROBOT, Broken(qd), "fix-orientation")(Q, V)
    assert result.status is Status.INACCURATE
    assert message in result.message
    assert not result.qd.any()
    np.testing.assert_array_equal(result.eps, -V)


def test_what_is_not_promised_is_sent_as_it_is() -> None:
    q = Q.copy()
    q[3] = ROBOT.q_min[3] + 1e-3  # the elbow a hair from its limit
    result = make_step(ROBOT, "task-priority", "position")(q, -2.0 * ROBOT.jacobian(q)[:3, 3])
    assert result.status is Status.SOLVED
    assert result.bound_violation > 0.1
    assert "a joint exceeds its velocity bound" in result.message
    assert result.qd.any()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"v": [0.1, np.nan, 0.0]}, "v: expected finite numbers"),
        ({"v": np.zeros(6)}, r"v: expected shape \(3,\) for mode fix-orientation"),
        ({"q": Q[:6]}, r"q: expected shape \(7,\)"),
        ({"gain": -1.0}, "gain: expected numbers not below 0"),
        ({"gian": 1.0}, "gian: expected an input among"),
    ],
)
def test_bad_input_is_named(given: dict[str, object], message: str) -> None:
    step = make_step(ROBOT, "gradient-projection", "fix-orientation")
    with pytest.raises(InputError, match=message):
        step(**({"q": Q, "v": V} | given))  # type: ignore[arg-type]  # that is the point


def test_last_command_must_be_given_where_it_is_needed() -> None:
    with pytest.raises(InputError, match="qd_prev: expected shape"):
        make_step(ROBOT, "weighted-least-norm", "position")(Q, V)


@pytest.mark.parametrize(
    ("name", "error", "message"),
    [
        ("task-priority(limit=none)", UnknownOptionError, "did you mean 'limits'"),
        ("task-priority(limits=soft)", ValueError, "limits: expected one of hard-stop, none, got 'soft'"),
        ("task-priority(posture_gain=-1)", ValueError, "posture_gain: expected a number that is not negative"),
        ("saturation-null-space(variant=best)", ValueError, "variant: expected one of basic, optimal"),
        ("gradient-projection(criterion=height)", ValueError, "criterion: expected one of joint-limits"),
        ("geometric-scaling(bounds=none)", ValueError, "bounds: expected one of thesis, viable"),
    ],
)
def test_bad_options_are_named(name: str, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        make_step(ROBOT, name, "position")


def test_names_lead_where_they_should() -> None:
    assert is_baseline("task-priority(limits=none)")
    assert is_baseline("kinqp.baselines:TaskPriority")
    assert not is_baseline("kinqp.formulations:JointSpace")
    assert not is_baseline("nowhere:Nothing")
    assert not is_baseline("joint-space + twist-limits(frame=tool)")
    assert make_step(ROBOT, "kinqp.baselines:TaskPriority(limits=none)", "position")(Q, V).status is Status.SOLVED
    with pytest.raises(PluginError, match="expected no options of a solver, got tolerance"):
        make_step(ROBOT, "task-priority", "position", tolerance=1e-9)
    with pytest.raises(PluginError, match="baseline: expected no options with an instance, got limits"):
        get_baseline(get_baseline("task-priority"), limits="none")
    with pytest.raises(PluginError, match="did you mean 'task-priority'"):
        get_baseline("task-priorty")


class Pull:
    """A hand that pulls to one side."""

    def twist(self, t: float, pose: np.ndarray) -> np.ndarray:  # noqa: ARG002  # as a Guide is called
        return np.array([0.0, 0.1, 0.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("baseline", available_baselines())
def test_every_baseline_runs_in_closed_loop(baseline: str) -> None:
    step = make_step(ROBOT, baseline, "fix-orientation")
    run = simulate(step, Pull(), Q, 0.2)
    assert set(run.status) == {Status.SOLVED}
    moved = run.position[-1] - run.position[0]
    np.testing.assert_allclose(moved, [0.0, 0.1 * 0.199, 0.0], atol=2e-4)
