"""`saturation-null-space`: joints at their bounds stay there, the others do the task; then the task is slowed down."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np

from .base import Baseline, Promise, Resolved
from .optimal_saturation import saturate_optimally
from .posture import check_gain, with_posture
from .saturation import Level, Problem, saturate

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import casadi as ca
    from numpy.typing import NDArray

    from ..formulations import Tick
    from .situation import Situation

    Array = NDArray[np.float64]

VARIANTS: Final[dict[str, Callable[[Problem], Level]]] = {"basic": saturate, "optimal": saturate_optimally}


@dataclass(frozen=True)
class SaturationNullSpace(Baseline):
    r"""Saturation in the null space, the thesis's algorithm B (thesis 3.1.7, eq. 3.7-3.9).

    The locked rows are the first task, the hand's the second, a posture may be the third. Each task is done in the null
    space of those before it; joints that would exceed their bounds are saturated one by one, the others make up for
    them (`kinqp.baselines.saturation.saturate`), and when there are none left the task is scaled down, its direction
    kept: **a joint resting on its limit that the task needs stops the arm.** At a singularity what is out of reach is
    left out of the task.

    A task's scale counts from what the tasks before it do to its rows, which is nothing unless drift is compensated.

    Sources: Flacco, De Luca, Khatib, ICRA 2012 (basic), IROS 2012 (several tasks), T-RO 2015 (optimal). As a QP it is
    `task-scaling`. Bounds are the house's (`bounds`), of which "thesis" are those of eq. 3.7 and 3.8.

    Parameters
    ----------
    variant : {"basic", "optimal"}
        Which joints are saturated: the most critical one after the other, for good; or those that the optimality
        conditions ask for.
    posture_gain : float
        k [1/s] of a third task -k (q - middle of the range), for the joints that have limits; 0: no such task.
    """

    variant: str = "basic"
    posture_gain: float = 0.0

    name: ClassVar[str] = "saturation-null-space"
    promises: ClassVar[frozenset[Promise]] = frozenset({"joint bounds", "locked rows"})

    def __post_init__(self) -> None:
        super().__post_init__()
        check_gain(self.posture_gain)
        if self.variant not in VARIANTS:
            raise ValueError(f"variant: expected one of {', '.join(VARIANTS)}, got {self.variant!r}")

    def ingredients(self, tick: Tick) -> dict[str, ca.SX]:
        """Position limits, which a posture needs."""
        _ = tick.q_min, tick.q_max
        return {}

    def resolve(self, at: Situation) -> Resolved:
        """Compute the command."""
        tasks = with_posture(at, self.posture_gain)
        problems, levels = _in_order(tasks, at.qd_lo, at.qd_hi, self.variant)
        passes = sum(level.iterations for level in levels)
        return Resolved(levels[-1].qd, passes, levels[-1].held, problems[1].factors.smallest())


def saturate_tasks(
    tasks: Sequence[tuple[Array, Array]], lower: Array, upper: Array, *, variant: str = "basic"
) -> tuple[Level, ...]:
    """Any number of tasks in strict order of priority, under joint bounds that contain zero.

    Parameters
    ----------
    tasks : sequence of (J, xd), shapes (m_i, nv) and (m_i,)
        First priority first.
    lower, upper : ndarray, shape (nv,)
        Joint velocity bounds [rad/s or m/s].
    variant : {"basic", "optimal"}
        See `SaturationNullSpace`.

    Returns
    -------
    tuple of Level
        One for each task; the last one's `qd` is the command.
    """
    return tuple(_in_order(tasks, lower, upper, variant)[1])


def _in_order(
    tasks: Sequence[tuple[Array, Array]], lower: Array, upper: Array, variant: str
) -> tuple[list[Problem], list[Level]]:
    """State and solve one task after the other."""
    qd, Z = np.zeros(len(lower)), np.eye(len(lower))
    problems: list[Problem] = []
    levels: list[Level] = []
    for J, xd in tasks:
        problems.append(Problem.state(J, xd, qd, Z, (lower, upper)))
        levels.append(VARIANTS[variant](problems[-1]))
        qd, Z = levels[-1].qd, problems[-1].left
    return problems, levels
