"""What rows leave behind that the compiled solver took up and dropped again on its way."""

from __future__ import annotations

import numpy as np

from kinqp.solvers import Status
from tests.codegen.compiled import compiled, interpreted


def test_dropped_rows_leave_no_rounding_in_the_command() -> None:
    """Eight steps to four active rows, with multipliers of 1e4: what they left made 1e-8 rad/s of joint 0."""
    case = ("ur5e", "cartesian-error-acceleration", "position")
    q = [
        -1.934718799188525e-09, 6.370401839506063e-09, 1.0764140926594398e-10,
        -4.163866550653275e-09, -2.913359197063627e-09, 5.2680135476526936e-09,
    ]  # fmt: skip
    qd_prev = [
        1.6378976560214227, -2.8195904781606385, -2.0713955754425473,
        -1.9263794848908962, -1.2204954111096413, -1.7778175934584612,
    ]  # fmt: skip
    v = np.zeros(3)
    result = compiled(*case, quick=True)(np.array(q), v, qd_prev=qd_prev)
    wanted = interpreted(*case)(q, v, qd_prev=qd_prev)
    assert result.status is wanted.status is Status.SOLVED
    assert result.iterations > len(result.active) > 2
    np.testing.assert_allclose(result.qd, wanted.qd, rtol=0.0, atol=1e-12)
