"""Switching modes in one library: no jump in the command, and locked rows exact again in time."""

from functools import cache
from typing import Any

import cffi
import numpy as np
import pytest

from kinqp.codegen.model import step_code
from kinqp.codegen.render import render_step
from kinqp.codegen.step import STEP_FLAGS
from kinqp.formulations import Mode, get_formulation
from kinqp.robots import load_robot
from kinqp.solvers import Status
from kinqp.solvers.active_set import STATUSES
from kinqp.solvers.native import build_library, declarations

MODES = ("fix-orientation", "line:z", "fix-position", "position")
TRANSITION = 0.1
DT = 1e-3


@cache
def library(formulation: str) -> tuple[Any, Any]:
    code = step_code(
        load_robot("lbr_med14"), get_formulation(formulation), [Mode.parse(m) for m in MODES], "kinqp_multi"
    )
    files = render_step(code)
    ffi = cffi.FFI()
    ffi.cdef(declarations(files["kinqp_multi.h"]))
    # Unoptimised: four modes take long to optimise, and not a bit of the answers depends on it.
    flags = ["-O0" if flag == "-O3" else flag for flag in STEP_FLAGS]
    return ffi, ffi.dlopen(str(build_library("kinqp_multi", files, flags=flags)))


def run(formulation: str, first: int, second: int, *, guide: bool, ticks: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Commands and states of a closed loop that changes mode half-way, the hand asking for the same all along."""
    ffi, lib = library(formulation)
    parameters, state = ffi.new("kinqp_multi_parameters *"), ffi.new("kinqp_multi_guide_state *")
    given, output = ffi.new("kinqp_multi_input *"), ffi.new("kinqp_multi_output *")
    lib.kinqp_multi_default_parameters(parameters)
    lib.kinqp_multi_start_guide(state)
    q = np.deg2rad([10.0, 40.0, 15.0, -70.0, -10.0, 50.0, 5.0])
    commands, states = [], []
    for tick in range(ticks):
        given.mode = first if tick < ticks // 2 else second
        given.q[0:7] = list(q)
        given.v[0:3] = [0.1, -0.05, 0.08]
        if guide:
            code = lib.kinqp_multi_guide(parameters, state, given, output)
        else:
            code = lib.kinqp_multi_step(parameters, given, output)
        assert STATUSES[code] is Status.SOLVED
        qd = np.array(list(output.qd))
        commands.append(qd)
        states.append(q)
        q = q + DT * qd
    return np.array(commands), np.array(states)


def largest_jump(commands: np.ndarray) -> float:
    return float(np.abs(np.diff(commands[1:], axis=0)).max())


SWITCHES = [(0, 1), (1, 0), (0, 2), (2, 1), (3, 0), (3, 1)]


@pytest.mark.parametrize(("first", "second"), SWITCHES)
@pytest.mark.parametrize("formulation", ["cartesian-error", "joint-space"])
def test_no_jump_where_the_mode_changes(formulation: str, first: int, second: int) -> None:
    plain, _ = run(formulation, first, second, guide=False)
    smooth, _ = run(formulation, first, second, guide=True)
    assert largest_jump(plain) > 0.03, "without the guide there is a jump to be taken away"
    # The blend takes 0.1 s; its steepest slope is 1.5 / 0.1 s of what it takes away, at most 1 rad/s here.
    assert largest_jump(smooth) <= 1.5 / TRANSITION * DT * 1.0 + 1e-3
    np.testing.assert_allclose(smooth[:200], plain[:200], atol=1e-12)


@pytest.mark.parametrize(("first", "second"), SWITCHES)
def test_locked_rows_are_exact_after_the_transition_and_throughout_if_both_modes_lock_them(
    first: int, second: int
) -> None:
    robot = load_robot("lbr_med14")
    commands, states = run("cartesian-error", first, second, guide=True)
    old, new = Mode.parse(MODES[first]), Mode.parse(MODES[second])
    for tick, (qd, q) in enumerate(zip(commands, states, strict=True)):
        mode = old if tick < 200 else new
        if 200 <= tick < 200 + round(TRANSITION / DT) + 1:
            both = 3 if set(old.fixed_rows) & set(new.fixed_rows) == {3, 4, 5} else 0
            if both:  # all three rotations, whatever the axes they are counted along
                assert np.abs(robot.jacobian(q)[3:] @ qd).max() <= 1e-9
            continue
        rows = mode.twist_map_at(robot.pose(q)) @ robot.jacobian(q)
        assert np.abs(rows[list(mode.fixed_rows)] @ qd).max(initial=0.0) <= 1e-9


def test_an_unknown_mode_fails_and_stops() -> None:
    ffi, lib = library("cartesian-error")
    parameters, state = ffi.new("kinqp_multi_parameters *"), ffi.new("kinqp_multi_guide_state *")
    given, output = ffi.new("kinqp_multi_input *"), ffi.new("kinqp_multi_output *")
    lib.kinqp_multi_default_parameters(parameters)
    lib.kinqp_multi_start_guide(state)
    given.q[0:7] = [0.1, 0.5, 0.1, -1.0, 0.1, 0.5, 0.1]
    given.v[0] = 0.1
    assert lib.kinqp_multi_guide(parameters, state, given, output) == 0
    sent = np.array(list(output.qd))
    given.mode = 7
    for _ in range(100):
        assert STATUSES[lib.kinqp_multi_guide(parameters, state, given, output)] is Status.FAILED
        assert (np.abs(np.array(list(output.qd)) - sent) <= 1.000001e-2).all(), "braking, 10 rad/s^2 for 1 ms"
        sent = np.array(list(output.qd))
    assert not sent.any()
