"""The gate in C: whatever bits come in, what leaves as solved keeps its promises, and the rest is a safe stop."""

import struct
from functools import cache
from typing import Any

import cffi
import numpy as np
import pytest

from kinqp.codegen.fields import identifier
from kinqp.codegen.model import StepCode, step_code
from kinqp.codegen.render import render_step
from kinqp.codegen.step import STEP_FLAGS
from kinqp.formulations import Mode, available_formulations, get_formulation
from kinqp.robots import load_robot
from kinqp.solvers import Status
from kinqp.solvers.active_set import STATUSES
from kinqp.solvers.native import CompilerError, build_library, declarations

NAN, INF = np.nan, np.inf
MODES = ("fix-orientation", "line:z")
Q = np.deg2rad([10.0, 40.0, 15.0, -70.0, -10.0, 50.0, 5.0])
LAST = np.array([0.3, -0.2, 0.4, 0.1, -0.5, 0.2, 0.05])
NONE, BRAKING, ZERO = range(3)
FINITE, SPEED, POSITION, ACCELERATION, LOCKED_ROWS = range(1, 6)


class Library:
    """A generated step, called with any bits."""

    def __init__(self, formulation: str) -> None:
        self.robot = load_robot("lbr_med14")
        self.prefix = identifier(f"gate_{formulation}")
        modes = [Mode.parse(mode) for mode in MODES]
        self.code: StepCode = step_code(self.robot, get_formulation(formulation), modes, self.prefix)
        files = render_step(self.code)
        self.header = files[f"{self.prefix}.h"]
        self.ffi = cffi.FFI()
        self.ffi.cdef(declarations(self.header))
        flags = ["-O1" if flag == "-O3" else flag for flag in STEP_FLAGS]
        self.lib: Any = self.ffi.dlopen(str(build_library(self.prefix, files, flags=flags)))
        self.parameters = self.ffi.new(f"{self.prefix}_parameters *")
        self.input = self.ffi.new(f"{self.prefix}_input *")
        self.output = self.ffi.new(f"{self.prefix}_output *")
        self.reset()

    def reset(self) -> None:
        getattr(self.lib, f"{self.prefix}_default_parameters")(self.parameters)
        self.input.mode = 0
        self.input.q[0:7] = list(Q)
        self.input.v[0:3] = [0.1, -0.05, 0.08]
        self.input.v_fixed[0:5] = [0.0] * 5
        if self.brakes:
            self.input.qd_prev[0:7] = list(LAST)

    @property
    def brakes(self) -> bool:
        return self.code.brakes

    def number(self, parameter: str) -> int:
        return int(getattr(self.lib, f"{self.prefix.upper()}_PARAMETER_{parameter.upper()}"))

    def put(self, parameter: str, value: float) -> None:
        place = getattr(self.parameters, parameter)
        if isinstance(place, float | int):
            setattr(self.parameters, parameter, value)
        else:
            place[len(place) - 1] = value

    def __call__(self) -> tuple[Status, np.ndarray]:
        code = getattr(self.lib, f"{self.prefix}_step")(self.parameters, self.input, self.output)
        assert code == self.output.status
        return STATUSES[code], np.array(list(self.output.qd))


@cache
def library(formulation: str) -> Library:
    return Library(formulation)


def fresh(formulation: str) -> Library:
    made = library(formulation)
    made.reset()
    return made


def is_safe_stop(made: Library, qd: np.ndarray) -> bool:
    """Zero where the step is not told the last command, else slower in every joint, within the acceleration limits."""
    robot = made.robot
    if not made.brakes:
        return made.output.stop == ZERO and not qd.any()
    change = np.abs(qd - LAST)
    within = (change <= robot.qdd_max * 1e-3 * (1 + 1e-9)).all() and (qd * LAST >= 0.0).all()
    return made.output.stop == BRAKING and bool(within and (np.abs(qd) <= np.abs(LAST)).all() and change.any())


SOME = ("joint-space", "cartesian-error", "joint-space-robust", "hierarchical")


@pytest.mark.parametrize("formulation", SOME)
def test_a_usable_tick_is_no_stop(formulation: str) -> None:
    made = fresh(formulation)
    status, qd = made()
    assert status is Status.SOLVED
    assert (made.output.stop, made.output.unmet, made.output.parameter) == (NONE, 0, 0)
    assert qd.any()


@pytest.mark.parametrize("formulation", SOME)
@pytest.mark.parametrize("value", [NAN, -1.0, -INF])
def test_every_parameter_is_looked_at(formulation: str, value: float) -> None:
    made = fresh(formulation)
    for field in made.code.parameters:
        if value == -INF and field.least == "-INFINITY":
            continue
        # The default of a parameter that may be anything finite is no error, and -1 is not either.
        if value == -1.0 and field.least.startswith("-"):
            continue
        made.reset()
        made.put(field.name, value)
        status, qd = made()
        named = made.number(field.name)
        assert status is Status.BAD_PARAMETER, field.name
        assert made.output.parameter == named, field.name
        assert is_safe_stop(made, qd), field.name
    made.reset()
    assert made()[0] is Status.SOLVED, "nothing is left of it"


@pytest.mark.parametrize("dt", [0.0, 1e-320, 9.99e-6, 1.001, INF, 1e308])
def test_a_clock_that_stands_still_is_a_bad_parameter(dt: float) -> None:
    made = fresh("joint-space-robust")
    made.parameters.dt = dt
    status, qd = made()
    assert status is Status.BAD_PARAMETER
    assert made.output.parameter == made.number("dt")
    assert is_safe_stop(made, qd)


def test_crossed_position_limits_and_a_negative_cap() -> None:
    made = fresh("joint-space")
    made.parameters.q_min[2] = made.parameters.q_max[2] + 1e-9
    assert made()[0] is Status.BAD_PARAMETER
    assert made.output.parameter == made.number("q_min")
    made.reset()
    made.parameters.max_iterations = -1
    assert made()[0] is Status.BAD_PARAMETER
    assert made.output.parameter == made.number("max_iterations")


@pytest.mark.parametrize(
    "formulation", ["joint-space", "cartesian-error", "joint-space-robust", "joint-space-acceleration"]
)
def test_without_acceleration_limits_position_limits_still_hold(formulation: str) -> None:
    made = fresh(formulation)
    for i in range(7):
        made.parameters.qdd_max[i] = INF
    q = made.robot.q_max - 1e-3 * np.arange(1.0, 8.0)
    made.input.q[0:7] = list(q)
    made.input.v[0:3] = [0.5, 0.5, -0.5]
    for last in (np.zeros(7), made.robot.qd_max):
        if made.brakes:
            made.input.qd_prev[0:7] = list(last)
        status, qd = made()
        assert status is Status.SOLVED
        assert (q + 1e-3 * qd <= made.robot.q_max + 1e-10).all()


@pytest.mark.parametrize("name", ["q", "v", "v_fixed", "qd_prev"])
@pytest.mark.parametrize("value", [NAN, INF, -INF])
@pytest.mark.parametrize("formulation", SOME)
def test_no_input_that_is_not_finite_gives_a_command(formulation: str, name: str, value: float) -> None:
    made = fresh(formulation)
    if name == "qd_prev" and not made.brakes:
        return
    getattr(made.input, name)[1] = value
    status, qd = made()
    assert status is Status.FAILED
    if name == "qd_prev":
        assert made.output.stop == ZERO, "the last command is not known"
        assert not qd.any()
    else:
        assert is_safe_stop(made, qd)
    assert np.isfinite(list(made.output.eps)).all()


@pytest.mark.parametrize("exponent", [9, 16, 21, 60, 160, 300])
@pytest.mark.parametrize("formulation", SOME)
def test_no_hand_is_too_fast(formulation: str, exponent: int) -> None:
    made = fresh(formulation)
    rng = np.random.default_rng(exponent)
    for _ in range(200):
        q = made.robot.q_min + (made.robot.q_max - made.robot.q_min) * rng.random(7)
        made.input.q[0:7] = list(q)
        made.input.v[0:3] = list(10.0**exponent * rng.normal(size=3))
        status, qd = made()
        assert np.isfinite(qd).all()
        if status is Status.SOLVED:
            assert (np.abs(qd) <= made.robot.qd_max + 1e-8).all()
        else:
            assert is_safe_stop(made, qd)


def test_locked_rows_that_cannot_move_as_asked_are_no_solution() -> None:
    made = fresh("cartesian-error")
    made.input.mode = 1
    made.input.q[0:7] = [0.5, 0.0, 0.0, -1.0, 0.0, 0.0, 0.3]
    made.input.v[0] = 0.0
    made.input.v_fixed[0:5] = [0.001, -0.001, 0.006, 0.001, -0.005]
    status, qd = made()
    assert status is Status.INACCURATE
    assert made.output.unmet == LOCKED_ROWS
    assert not qd.any()


def test_a_brake_from_an_impossible_command_is_within_the_velocity_limits() -> None:
    made = fresh("joint-space-robust")
    made.input.v[0] = NAN
    made.input.qd_prev[0:7] = [1e300, -1e300, 1e9, -5.0, 0.0, 3.0, -0.0]
    status, qd = made()
    assert status is Status.FAILED
    assert (np.abs(qd) <= made.robot.qd_max).all()


def test_where_the_position_is_unknown_every_joint_brakes_on_its_own() -> None:
    made = fresh("joint-space-robust")
    made.input.q[3] = NAN
    status, qd = made()
    assert status is Status.FAILED
    step = made.robot.qdd_max * 1e-3
    np.testing.assert_allclose(qd, np.sign(LAST) * np.maximum(np.abs(LAST) - step, 0.0), atol=1e-15)


def test_a_brake_that_limits_stand_in_the_way_of_keeps_to_the_acceleration_limits() -> None:
    made = fresh("joint-space-robust")
    # A millirad before its limit, with 0.3 rad/s: it can't be stopped there.
    made.input.q[0] = made.robot.q_max[0] - 1e-3
    made.input.v[0] = NAN
    _, qd = made()
    step = made.robot.qdd_max * 1e-3
    assert qd[0] == pytest.approx(LAST[0] - step[0], abs=1e-15)
    assert (np.abs(qd - LAST) <= step * (1 + 1e-9)).all()


@pytest.mark.parametrize("formulation", ["joint-space", "joint-space-robust"])
def test_blended_modes_brake_from_what_they_sent(formulation: str) -> None:
    made = fresh(formulation)
    state = made.ffi.new(f"{made.prefix}_guide_state *")
    getattr(made.lib, f"{made.prefix}_start_guide")(state)
    guide = getattr(made.lib, f"{made.prefix}_guide")
    q, sent = Q.copy(), np.zeros(7)
    for tick in range(40):
        bad = 10 <= tick < 20
        made.input.mode = int(tick >= 30)
        made.input.q[0:7] = list(q)
        made.input.v[0] = NAN if bad else 0.1
        made.parameters.transition = NAN if tick == 25 else 0.1
        if made.brakes:
            made.input.qd_prev[0:7] = list(sent)
        status = STATUSES[guide(made.parameters, state, made.input, made.output)]
        qd = np.array(list(made.output.qd))
        assert np.isfinite(qd).all()
        if bad or tick == 25:
            assert status is (Status.BAD_PARAMETER if tick == 25 else Status.FAILED)
            assert made.output.stop == BRAKING
            assert (np.abs(qd - sent) <= made.robot.qdd_max * 1e-3 * (1 + 1e-9)).all()
        else:
            assert status is Status.SOLVED
        q, sent = q + 1e-3 * qd, qd
    assert all(np.isfinite(list(getattr(state, name))).all() for name in ("qd", "q", "left_v", "left_fixed"))


@pytest.mark.parametrize("flags", [["-ffast-math"], ["-Ofast"], ["-ffinite-math-only"]])
def test_flags_that_forget_nan_are_refused(flags: list[str]) -> None:
    made = library("joint-space")
    files = render_step(made.code)
    with pytest.raises(CompilerError, match="IEEE 754"):
        build_library("fast", files, flags=[flag for flag in STEP_FLAGS if flag != "-O3"] + flags)


@pytest.mark.long
@pytest.mark.parametrize("formulation", available_formulations())
def test_any_bits_in_every_input_and_parameter(formulation: str) -> None:
    any_bits(formulation, 20_000)


@pytest.mark.parametrize("formulation", SOME)
def test_some_bits_in_every_input_and_parameter(formulation: str) -> None:
    any_bits(formulation, 500)


def any_bits(formulation: str, ticks: int) -> None:
    """Finite, and within what the parameters say where it is solved, whatever the 64 bits of every double."""
    made = fresh(formulation)
    rng = np.random.default_rng(7)
    names = [field.name for field in made.code.parameters]
    special = [0.0, -0.0, NAN, INF, -INF, 5e-324, 1e308, -1e308, 1e-5, 1.0, -1.0]

    def number() -> float:
        if rng.random() < 0.5:
            return float(rng.choice(special))
        return float(struct.unpack("<d", rng.bytes(8))[0])

    for _ in range(ticks):
        made.reset()
        for _ in range(rng.integers(1, 4)):
            target = made.parameters if rng.random() < 0.6 else made.input
            fields = names if target is made.parameters else [field.name for field in made.code.inputs]
            place = getattr(target, str(name := rng.choice(fields)))
            if isinstance(place, float | int):
                setattr(target, str(name), number())
            else:
                place[int(rng.integers(len(place)))] = number()
        status, qd = made()
        assert np.isfinite(qd).all()
        limits = np.array(list(made.parameters.qd_max))
        if status is Status.SOLVED:
            assert (np.abs(qd) <= limits + 1e-8).all()
            at = np.array(list(made.input.q))
            low, high = (np.array(list(getattr(made.parameters, name))) for name in ("q_min", "q_max"))
            further = made.parameters.dt * qd
            assert (
                ((further <= 1e-10) | (at + further <= high + 1e-10))
                & ((further >= -1e-10) | (at + further >= low - 1e-10))
            ).all()
