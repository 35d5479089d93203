"""Lost samples, bad parameters and ticks that can't be solved: the guiding controller brakes, and goes on."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

from kinqp.control import CompiledGuiding, GuidingController, GuidingPhase, GuidingSettings, make_guiding
from kinqp.formulations import InputError
from kinqp.robots import load_robot
from kinqp.solvers import Status

NAN, INF = np.nan, np.inf
DT = 1e-3
Q = np.deg2rad([0.0, 30.0, 0.0, -70.0, 0.0, 80.0, 0.0])
PULL = np.array([0.0, 12.0, -3.0, 0.0, 0.0, 0.0])
LOST = np.full(6, NAN)
MODES = ("fix-orientation", "line:z")
FORMULATIONS = ("joint-space", "cartesian-error", "joint-space-robust")
Controller = GuidingController | CompiledGuiding


@cache
def made(formulation: str, *, compiled: bool) -> Any:
    return make_guiding(load_robot("lbr_med14"), formulation, MODES, compiled=compiled)


@pytest.fixture(params=[False, True], ids=["python", "compiled"])
def controller(request: pytest.FixtureRequest) -> Callable[[str], Controller]:
    def get(formulation: str) -> Controller:
        found: Controller = made(formulation, compiled=request.param)
        found.reset()
        return found

    return get


class Arm:
    """An ideal arm that carries out commands, and remembers how hard it was accelerated."""

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self.q, self.sent, self.hardest = Q.copy(), np.zeros(7), 0.0

    def tick(self, wrench: np.ndarray, q: np.ndarray | None = None) -> Any:
        result = self.controller(self.q if q is None else q, wrench)
        assert np.isfinite(result.qd).all()
        self.hardest = float(np.abs((result.qd - self.sent) / DT / self.controller.robot.qdd_max).max())
        self.sent, self.q = result.qd, self.q + DT * result.qd
        return result

    def guided(self, ticks: int = 200) -> "Arm":
        for _ in range(ticks):
            self.tick(PULL)
        return self


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_lost_sample_is_held_and_nothing_is_felt(controller: Any, formulation: str) -> None:
    arm = Arm(controller(formulation)).guided()
    for lost in range(1, 6):
        result = arm.tick(LOST)
        assert (result.status, result.held) == (Status.SOLVED, lost)
        assert arm.hardest <= 0.5
    assert arm.tick(PULL).held == 0


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("position", [False, True])
def test_samples_lost_for_longer_end_in_braking_and_a_stop(controller: Any, formulation: str, position: bool) -> None:
    arm = Arm(controller(formulation)).guided()
    for lost in range(1, 26):
        result = arm.tick(PULL if position else LOST, np.full(7, NAN) if position else None)
        assert arm.hardest <= 1.0 + 1e-9
        if lost > 5:
            assert result.status is Status.FAILED
            assert arm.hardest >= 0.99, "the fastest braking"
    assert arm.controller.phase is not GuidingPhase.GUIDING
    for _ in range(400):
        arm.tick(PULL)
        assert arm.hardest <= 1.0 + 1e-9 or formulation != "joint-space-robust"
    assert arm.controller.phase is GuidingPhase.STOPPED
    assert not arm.sent.any()
    arm.controller.resume()
    arm.guided(50)
    assert arm.controller.phase is GuidingPhase.GUIDING
    assert arm.sent.any()


def test_after_a_brake_the_hand_goes_on_without_a_jump(controller: Any) -> None:
    arm = Arm(controller("joint-space")).guided()
    for _ in range(8):
        arm.tick(LOST)
    arm.tick(PULL)
    assert arm.hardest <= 1.0


def test_a_stop_does_not_carry_the_arm_back(controller: Any) -> None:
    arm = Arm(controller("joint-space-robust")).guided(400)
    forward = np.sign(arm.sent)
    for _ in range(25):
        arm.tick(LOST)
    for _ in range(300):
        arm.tick(PULL)
        assert (arm.sent * forward >= -2e-3).all()


def test_nothing_is_known_before_the_first_sample(controller: Any) -> None:
    arm = Arm(controller("joint-space"))
    result = arm.tick(LOST)
    assert result.status is Status.FAILED
    assert not result.qd.any()
    assert arm.guided(50).sent.any()


def test_only_shapes_and_kinds_are_errors(controller: Any) -> None:
    found = controller("joint-space")
    with pytest.raises(InputError, match=r"^wrench: expected shape \(6,\)"):
        found(Q, np.zeros(5))
    with pytest.raises(InputError, match=r"^q: "):
        found([True] * 7, np.zeros(6))


def test_python_and_c_agree_over_any_order_of_events() -> None:
    rng = np.random.default_rng(3)
    pair = [made("joint-space", compiled=compiled) for compiled in (False, True)]
    for found in pair:
        found.reset()
    q = Q.copy()
    for _ in range(1500):
        event = rng.random()
        if event < 0.01:
            mode = str(rng.choice(MODES))
            for found in pair:
                found.engage(mode)
        elif event < 0.02:
            for found in pair:
                found.stop() if event < 0.013 else found.resume()
        lost = rng.random() < 0.1
        wrench = LOST if lost else 20.0 * rng.normal(size=6) * [1, 1, 1, 0.05, 0.05, 0.05]
        one, other = (found(q, wrench) for found in pair)
        np.testing.assert_allclose(one.qd, other.qd, atol=1e-9)
        assert (one.status, one.phase, one.held, one.mode) == (other.status, other.phase, other.held, other.mode)
        q = q + DT * other.qd


@pytest.mark.parametrize("name", ["dt", "qdd_max", "q_max"])
@pytest.mark.parametrize("value", [NAN, 0.0, -1.0])
def test_a_bad_parameter_brakes_and_leaves_nothing_behind(name: str, value: float) -> None:
    if name == "q_max" and value != value:
        value = -INF  # below the lower limit
    elif name == "q_max":
        value = -9.0
    found = made("joint-space", compiled=True)
    found.reset()
    arm = Arm(found).guided()
    step = found._parameters.step  # as a C program has it: `set` refuses such values
    place = getattr(step, name)
    before = place if isinstance(place, float) else list(place)
    put = (
        (lambda x: setattr(step, name, x))
        if isinstance(place, float)
        else (lambda x: place.__setitem__(slice(0, 7), x))
    )
    put(value if isinstance(place, float) else [value] * 7)
    for _ in range(10):
        result = arm.tick(PULL)
        assert result.status is Status.BAD_PARAMETER
        assert 0.99 <= arm.hardest <= 1.0 + 1e-9
    put(before)
    assert arm.tick(PULL).status is Status.SOLVED
    assert arm.hardest <= 1.0
    assert arm.controller.phase is GuidingPhase.GUIDING


def test_a_setting_that_is_bad_is_named() -> None:
    found = made("joint-space", compiled=True)
    found.reset()
    arm = Arm(found).guided()
    found._parameters.limit_share = NAN
    assert arm.tick(PULL).status is Status.BAD_PARAMETER
    prefix = next(name for name in dir(found._library) if name.endswith("_SETTING_LIMIT_SHARE"))
    assert found._output.parameter == getattr(found._library, prefix)
    found._parameters.limit_share = 0.2
    assert arm.tick(PULL).status is Status.SOLVED


def test_a_wrench_beyond_all_measure_moves_nothing_beyond_the_limits(controller: Any) -> None:
    arm = Arm(controller("cartesian-error")).guided()
    for force in (1e6, 1e21, 1e160, 1e308):
        result = arm.tick(np.array([force, 0.0, 0.0, 0.0, 0.0, 0.0]))
        assert (np.abs(result.qd) <= arm.controller.robot.qd_max + 1e-8).all()
        for _ in range(3):
            assert (np.abs(arm.tick(PULL).qd) <= arm.controller.robot.qd_max + 1e-8).all()


@pytest.mark.parametrize("count", [-1, 1.5, True, NAN])
def test_hold_ticks_is_a_count(count: float) -> None:
    with pytest.raises(ValueError, match=r"^hold_ticks: expected a count of at least 0"):
        GuidingSettings(hold_ticks=count)  # type: ignore[arg-type]  # that is the test
