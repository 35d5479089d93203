"""Where the proof meets the C code's widened bounds and its tolerance: hands of 100 m/s, bounds of 5e-9 rad/s."""

from __future__ import annotations

import numpy as np
import pytest

from kinqp.benchmarks.certify import DualMethod, Slice, SliceError, certify, follow
from kinqp.benchmarks.certify.agreement import TOLERANCE
from kinqp.benchmarks.certify.cone import rounded
from kinqp.codegen import CompiledStep, compile_step
from kinqp.control import InterpretedStep, make_step
from kinqp.formulations import CartesianError, Mode
from kinqp.robots import load_robot

MODE = "fix-orientation"
ROBOT = load_robot("lbr_med14")
# A joint on its limit, one near it, the others inside.
Q = np.array([0.3, 0.7, -0.4, float(ROBOT.q_min[3]), 0.5, float(ROBOT.q_max[5]) - 1e-5, -0.2])


@pytest.fixture(scope="module")
def interpreted() -> InterpretedStep:
    return make_step(ROBOT, CartesianError(), MODE)


@pytest.fixture(scope="module")
def compiled() -> CompiledStep:
    return compile_step(ROBOT, CartesianError(), Mode.parse(MODE))


def test_each_hand_is_in_one_piece_and_there_bounds_are_as_wide_as_declared(interpreted: InterpretedStep) -> None:
    slice_, rng = Slice(interpreted, Q), np.random.default_rng(0)
    assert len(slice_.pieces) == 16
    counts = [len(Slice(interpreted, Q, speed=speed).pieces) for speed in (1.0, 3.3e3, 3.4e3)]
    assert counts == [8, 8, 16]  # bounds are as wide as they get from 1e4 m/s on, three axes together
    hands = rng.normal(size=(24, 3)) * 10.0 ** rng.uniform(0.0, 6.0, (24, 1))
    for v in (*hands, np.zeros(3), np.array([0.0, -1.0, 0.0]), np.array([1e4, 0.0, -1e4])):
        theta = rounded(np.append(v, 1.0))
        assert sum(piece.holds(theta) for piece in slice_.pieces) == 1
        if not v.any():
            continue
        qp = interpreted.evaluate(Q, v).qp
        lengths = np.linalg.norm(qp.C, axis=1) * np.linalg.norm(v)
        method = slice_.method(theta)
        for row in range(7):
            # The widening itself is 1e-14 of these, up to 1e4 m/s.
            assert method.distance((), (row, -1), theta) == pytest.approx(qp.l[row] / lengths[row], abs=1e-15)
            assert method.distance((), (row, 1), theta) == pytest.approx(-qp.u[row] / lengths[row], abs=1e-15)
    with pytest.raises(SliceError, match="theta: expected one of the slice"):
        Slice(interpreted, Q, speed=1.0).method(rounded(np.array([2.0, 0.0, 0.0, 1.0])))


# A state that a search of a million ticks found: four joints on limits, the fourth 5e-9 rad/s from one.
WORST_Q = np.array(
    [
        *(-1.14129169073382, 0.4343288380957029, -1.667235335408888, 0.4347792133402087),
        *(2.4309611599838967, -0.47914842936420243, 1.5755390715938105),
    ]
)
WORST_LIMITS = {
    "qd_max": np.array(
        [
            *(0.2183334164776424, 1.3300356254732448, 0.46273476289669385, 0.34701215953951137),
            *(1.5609043129791693, 0.5020670721805978, 0.4577331881420498),
        ]
    ),
    "qdd_max": np.array(
        [
            *(2.8119570601847883, 4.396840502025401, 2.5167699300148745, 1.5515290536799515),
            *(4.852818921921531, 8.132803019449346, 9.728165551257064),
        ]
    ),
    "q_min": np.array(
        [
            *(-1.14129169073382, -1.3921896933390163, -1.6597451369196399, -2.0180825584011792),
            *(-2.7610965619234586, -0.47914951635954206, -2.1731341340272246),
        ]
    ),
    "q_max": np.array(
        [
            *(0.8036698598528775, 0.4343289115656579, 1.1912637925141216, 0.43477921334509095),
            *(2.4309611599838967, 1.4322622297271677, 1.5722482331204541),
        ]
    ),
}


@pytest.mark.parametrize(
    ("v", "proved", "taken"),
    [
        ((-41.8729, 44.4028, -93.6534), 11, 9),
        ((-56.3719, 32.9677, -88.5922), 17, 15),
        ((-55.5599, 34.143, -90.7064), 21, 19),
    ],
)
def test_a_fast_hand_stops_at_the_tolerance_where_widened_bounds_do(
    interpreted: InterpretedStep, compiled: CompiledStep, v: tuple[float, ...], proved: int, taken: int
) -> None:
    # The last row is outside by 1.03e-12 to 1.05e-12 of the hand, and by 0.96e-12 to 0.98e-12 where bounds are widened.
    slice_, theta = Slice(interpreted, WORST_Q, WORST_LIMITS), rounded(np.array([*v, 1.0]))
    low, high = slice_.bounds
    narrow = DualMethod(slice_.M, low[:, None], high[:, None])
    assert follow(narrow, theta)[0] == follow(narrow, theta, TOLERANCE)[0] == proved
    assert follow(slice_.method(theta), theta)[0] == proved
    assert follow(slice_.method(theta), theta, TOLERANCE)[0] == taken
    assert compiled(WORST_Q, np.array(v), **WORST_LIMITS).iterations == taken


def test_the_first_row_enters_however_little_it_is_outside(
    interpreted: InterpretedStep, compiled: CompiledStep
) -> None:
    slice_ = Slice(interpreted, Q)
    row = slice_.M[3] / np.linalg.norm(slice_.M[3])
    along = np.cross(row, [1.0, 0.0, 0.0])
    v = 1e-3 * along / np.linalg.norm(along)
    v -= 5e-13 * 1e-3 * row  # the joint is on its lower limit
    theta = rounded(np.append(v, 1.0))
    method = slice_.method(theta)
    assert 0.0 < method.distance((), (3, -1), theta) < 0.6 * TOLERANCE
    assert compiled(Q, v).iterations == follow(method, theta)[0] == follow(method, theta, TOLERANCE)[0] == 1


@pytest.mark.parametrize("speed", [1e3, None])
def test_where_bounds_are_less_than_the_tolerance_the_compiled_tick_stops_as_soon_as_rows_hold_to_it(
    speed: float | None,
) -> None:
    mode, rng = "plane:0,1,0", np.random.default_rng(0)
    # Joints 1e-13 rad from limits may move by 1e-10 rad/s, and rows hold to 1e-12 of a hand of up to 1 km/s.
    q = np.where(rng.random(7) < 0.5, ROBOT.q_min + 1e-13, ROBOT.q_max - 1e-13)
    q[[0, 2]] = 0.3
    step = compile_step(ROBOT, CartesianError(), Mode.parse(mode))
    found = certify(Slice(make_step(ROBOT, CartesianError(), mode), q, speed=speed), step)
    assert found.agreement.tolerated > 10
    assert found.agreement.differing == 0
    assert found.attained.compiled <= found.attained.proved == found.iterations
