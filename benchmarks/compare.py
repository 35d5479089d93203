"""What got better or worse from one sweep to another, beyond noise."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from .compare_cell import THRESHOLDS, Finding, compare_ticks, correctness
from .errors import CompareError
from .scenarios import get_scenario
from .time_ratio import MIN_REPEATS, time_ratios

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import polars as pl

    from .cells import Cell
    from .compare_cell import Verdict
    from .store import Store
    from .time_ratio import TimeRatio

#: Conditions that change times without any change of ours. The rest (versions, revision) may be what is compared.
MACHINE: Final = ("cpu", "cores", "system")
#: A time counts as changed where its whole interval lies beyond this share.
TOLERANCE: Final = 0.10


@dataclass(frozen=True)
class Comparison:
    """Two sweeps beside each other.

    Attributes
    ----------
    compared : int
        Cells that both sides have run.
    findings : tuple of Finding
        All that differs, what is worse first.
    only_a, only_b : tuple of str
        Cells that only one side has, or has run.
    times_compared : bool
        Whether times were; False on different machines unless it is allowed.
    timed : int
        Cells whose times were compared.
    warnings : tuple of str
        What a reader must know before believing any of it.
    rules : dict
        Thresholds that the findings were judged by.
    """

    compared: int
    findings: tuple[Finding, ...]
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]
    times_compared: bool
    timed: int
    warnings: tuple[str, ...]
    rules: dict[str, Any] = field(default_factory=dict)

    def of(self, verdict: Verdict) -> tuple[Finding, ...]:
        """Findings of one verdict."""
        return tuple(one for one in self.findings if one.verdict == verdict)

    @property
    def regressed(self) -> bool:
        """Whether anything got worse."""
        return bool(self.of("worse"))

    def to_json(self) -> dict[str, Any]:
        """For `json`: all of it, and `regressed`."""
        return {"regressed": self.regressed, **asdict(self)}


def compare(
    a: Store,
    b: Store,
    *,
    allow_other_machine: bool = False,
    tolerance: float = TOLERANCE,
    confidence: float = 0.99,
    times: bool = True,
) -> Comparison:
    """Compare sweep B with sweep A, cell by cell.

    Correctness and iterations are compared exactly: the same solver on the same problems gives the same numbers. Times
    are compared as ratios with bootstrap intervals, by each clock for itself, and only where the machine is the same.

    Parameters
    ----------
    a, b : Store
        Results folders: before, and after.
    allow_other_machine : bool
        Compare times although the machine differs.
    tolerance : float
        Times count as changed where the whole interval of their ratio lies beyond 1 + tolerance, or below its inverse.
    confidence : float
        Of that interval.
    times : bool
        False: leave times alone.

    Returns
    -------
    Comparison

    Raises
    ------
    StoreError
        When one of the folders holds no sweep.
    CompareError
        When the two have no cell in common, or a number is out of range.
    """
    if not (np.isfinite(tolerance) and tolerance >= 0.0):
        raise CompareError(f"tolerance: expected a share of at least 0, got {tolerance}")
    if not 0.0 < confidence < 1.0:
        raise CompareError(f"confidence: expected a number between 0 and 1, got {confidence}")
    of_a, of_b = _run(a), _run(b)
    common = [cell for cell in of_a if cell in set(of_b)]
    if not common:
        raise CompareError(
            f"{a.folder} and {b.folder}: expected cells that both have run, got none; sweep the same configuration "
            "twice"
        )
    warnings, same_machine = _conditions(a.manifest.conditions, b.manifest.conditions)
    judge_times = times and (same_machine or allow_other_machine)
    if times and not judge_times:
        warnings.append("times were not compared: the machines differ (--allow-other-machine compares them anyway)")
    findings: list[Finding] = []
    ratios: list[float] = []
    timed = 0
    for cell in common:
        found, ratio = _compare_cell(a, b, cell, tolerance if judge_times else None, confidence)
        findings += found
        timed += ratio is not None
        ratios += [] if ratio is None else [ratio]
    if judge_times:
        warnings += _about_times(ratios, len(common))
    rank = {"worse": 0, "changed": 1, "better": 2}
    findings.sort(key=lambda one: (rank[one.verdict], one.measure, one.cell))
    return Comparison(
        compared=len(common),
        findings=tuple(findings),
        only_a=_only(of_a, of_b),
        only_b=_only(of_b, of_a),
        times_compared=judge_times,
        timed=timed,
        warnings=tuple(warnings),
        rules={"tolerance": tolerance, "confidence": confidence, "min_repeats": MIN_REPEATS, "thresholds": THRESHOLDS},
    )


def _run(store: Store) -> list[Cell]:
    """Cells of a folder whose accuracy part has ended, one way or the other."""
    return [cell for cell in store.manifest.cells if store.outcome(cell).accuracy is not None]


def _only(these: Sequence[Cell], those: Iterable[Cell]) -> tuple[str, ...]:
    others = set(those)
    return tuple(str(cell) for cell in these if cell not in others)


def _conditions(a: dict[str, str], b: dict[str, str]) -> tuple[list[str], bool]:
    differing = [key for key in dict.fromkeys([*a, *b]) if a.get(key) != b.get(key) and key != "date"]
    warnings = [
        f"{key} differs: {a.get(key, 'not recorded')} in A, {b.get(key, 'not recorded')} in B" for key in differing
    ]
    return warnings, not any(key in differing for key in MACHINE)


def _about_times(ratios: list[float], cells: int) -> list[str]:
    if not ratios:
        return [f"times were not compared: no cell has {MIN_REPEATS} repeats or more on both sides"]
    warnings = []
    if len(ratios) < cells:
        warnings.append(
            f"times were compared in {len(ratios)} of {cells} cells: the rest have no times, or too few repeats"
        )
    drift = float(np.exp(np.median(np.log(ratios))))
    if not 0.95 < drift < 1.05:
        warnings.append(
            f"half of all cells take {drift:.2f} times as long or longer (wall, typical tick): the machine's state, or "
            "code that all cells share, changed"
        )
    return warnings


def _compare_cell(
    a: Store, b: Store, cell: Cell, tolerance: float | None, confidence: float
) -> tuple[list[Finding], float | None]:
    """Findings of a cell, and its typical ratio of wall times where these were compared."""
    failed_a, failed_b = a.outcome(cell).failed, b.outcome(cell).failed
    found = correctness(str(cell), failed_a, failed_b)
    ticks_a, ticks_b = _ticks(a, cell), _ticks(b, cell)
    if ticks_a is not None and ticks_b is not None:
        found += compare_ticks(str(cell), ticks_a, ticks_b, get_scenario(cell.scenario))
    times_a, times_b = (None, None) if tolerance is None else (a.times(cell), b.times(cell))
    if tolerance is None or times_a is None or times_b is None:
        return found, None
    typical: float | None = None
    for one in time_ratios(times_a, times_b, confidence=confidence):
        if one.clock == "wall" and one.statistic == "typical":
            typical = one.ratio
        finding = _of_time(str(cell), one, tolerance)
        found += [] if finding is None else [finding]
    return found, typical


def _ticks(store: Store, cell: Cell) -> pl.DataFrame | None:
    try:
        return store.ticks(cell)
    except FileNotFoundError:  # a cell that failed may have none
        return None


def _of_time(cell: str, one: TimeRatio, tolerance: float) -> Finding | None:
    if one.low > 1.0 + tolerance:
        verdict: Verdict = "worse"
    elif one.high < 1.0 / (1.0 + tolerance):
        verdict = "better"
    else:
        return None
    text = (
        f"{one.ratio:.2f} times as long ({one.low:.2f} to {one.high:.2f}); {one.ticks} problems, "
        f"{one.repeats[0]} and {one.repeats[1]} repeats"
    )
    measure = f"time {one.clock} {one.statistic} [s]"
    return Finding(cell, measure, verdict, one.a, one.b, text, ratio=one.ratio, interval=(one.low, one.high))
