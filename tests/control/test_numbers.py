"""What is no real number is refused wherever joint values come in, whatever NumPy would make of it."""

import functools
from collections.abc import Callable
from decimal import Decimal
from typing import Any

import numpy as np
import pytest

from kinqp.codegen import compile_step
from kinqp.control import make_guiding, make_step
from kinqp.control.inverse_kinematics import InverseKinematics
from kinqp.robots import real_array
from tests.robots.arms import arm

#: Each of two entries.
NO_NUMBERS: dict[str, Any] = {
    "truth values": [True, False],
    "array of truth values": np.array([True, False]),
    "a truth value among numbers": [0.5, True],
    "NumPy's truth value among numbers": [0.5, np.bool_(True)],
    "words": ["0.5", "0.5"],
    "bytes": np.array([b"0.5", b"0.5"]),
    "a word among numbers": [0.5, "0.5"],
    "complex": [0.5, 0.5 + 1e-9j],
    "complex without an imaginary part": np.array([0.5, 0.5], dtype=complex),
    "masked": np.ma.array([0.5, 0.5], mask=[False, True]),
    "masked among others": [np.ma.array([0.5], mask=[True]), [0.5]],
    "nothing masked": np.ma.array([0.5, 0.5]),
    "objects": np.array([0.5, 0.5], dtype=object),
    "decimals": [Decimal("0.5"), Decimal("0.5")],
    "dates": np.array(["2020-01-01", "2020-01-02"], dtype="datetime64[D]"),
    "durations": np.array([1, 2], dtype="timedelta64[s]"),
    "nothing": [None, 0.5],
    "ragged": [[0.5], [0.5, 0.5]],
    "set": {0.5, 0.6},
    "mapping": {"a": 0.5},
}
bad = pytest.mark.parametrize("given", NO_NUMBERS.values(), ids=NO_NUMBERS.keys())


@bad
def test_no_numbers(given: Any) -> None:
    with pytest.raises(ValueError, match=r"^q: expected real numbers, got"):
        real_array("q", given)


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.float16, np.longdouble, np.int8, np.uint64])
def test_numbers(kind: type) -> None:
    found = real_array("q", np.array([1, 2], dtype=kind))
    assert found.dtype == np.float64
    assert found.tolist() == [1.0, 2.0]


def of_five(given: Any) -> Any:
    """Make an input of five joints of one of two entries."""
    if isinstance(given, np.ma.MaskedArray):
        return np.ma.concatenate([given, given, given[:1]])
    return np.concatenate([given, given, given[:1]]) if isinstance(given, np.ndarray) else [*given, *given, *given][:5]


@functools.cache
def entries() -> dict[str, Callable[[Any], object]]:
    """Places where five joint positions come in, and one where five velocities do."""
    robot = arm("davinci5")
    still = np.zeros(5)
    step, compiled = make_step(robot, "cartesian-error", "line:z"), compile_step(robot, "cartesian-error", "line:z")
    guiding = make_guiding(robot, "cartesian-error", ["line:z"])
    guiding_c = make_guiding(robot, "cartesian-error", ["line:z"], compiled=True)
    return {
        "robot": robot.pose,
        "step": lambda q: step(q, [0.0]),
        "step's limits": lambda qd_max: step(still, [0.0], qd_max=qd_max),
        "compiled step": lambda q: compiled(q, [0.0]),
        "compiled step's limits": lambda qd_max: compiled(still, [0.0], qd_max=qd_max),
        "batch": lambda q: compiled.batch([q], [[0.0]]),
        "guiding": lambda q: guiding(q, np.zeros(6)),
        "guiding in C": lambda q: guiding_c(q, np.zeros(6)),
        "inverse kinematics": lambda q0: InverseKinematics(robot)([0.1, 0.1, 0.1], q0),
    }


@pytest.mark.parametrize("where", entries().keys())
def test_refused_wherever_numbers_come_in(where: str) -> None:
    take = entries()[where]
    for given in ("truth values", "words", "complex", "masked", "objects"):
        with pytest.raises(ValueError, match="expected real numbers"):
            take(of_five(NO_NUMBERS[given]))
