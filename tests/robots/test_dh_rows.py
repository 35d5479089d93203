"""Arms from DH rows: useless rows are refused, and both kinds of joint take their constants."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from kinqp.robots import DhRow, RobotError, robot_from_dh

_ROW: dict[str, Any] = {"name": "one", "kind": "revolute", "q_min": -1.0, "q_max": 1.0, "qd_max": 1.0}


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([], r"^rows: expected at least one DH row, got none"),
        ([{}, {}], r"^rows: expected different joint names, got one, one$"),
        ([{"kind": "ball"}], r"^joint 'one': expected kind 'revolute' or 'prismatic', got 'ball'$"),
        ([{"a": np.nan}], r"^joint 'one': expected finite DH parameters, got DhRow\(.*a=nan"),
        ([{"q_min": 2.0}], r"^joint 'one': expected finite limits q_min < q_max, got 2.0 and 1.0$"),
        ([{"qd_max": 0.0}], r"^joint 'one': expected positive limits, got qd_max=0.0 and tau_max=inf$"),
        ([{"tau_max": -1.0}], r"^joint 'one': expected positive limits, got qd_max=1.0 and tau_max=-1.0$"),
    ],
)
def test_useless_dh_rows(rows: list[dict[str, Any]], message: str) -> None:
    with pytest.raises(RobotError, match=message):
        robot_from_dh("bad", [DhRow(**(_ROW | row)) for row in rows])


def test_dh_constants_of_every_joint_count() -> None:
    rows = [
        DhRow(name="p", kind="prismatic", theta=0.3, d=0.1, a=0.2, alpha=0.4, q_min=-1, q_max=1, qd_max=1),
        DhRow(name="r", kind="revolute", theta=-0.5, d=0.3, a=-0.1, alpha=0.7, q_min=-1, q_max=1, qd_max=1),
    ]

    def transform(theta: float, d: float, a: float, alpha: float) -> np.ndarray:
        c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
        return np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]])

    expected = transform(0.3, 0.1 + 0.6, 0.2, 0.4) @ transform(-0.5 - 0.8, 0.3, -0.1, 0.7)
    np.testing.assert_allclose(robot_from_dh("two", rows).pose([0.6, -0.8]), expected, rtol=0.0, atol=1e-15)
