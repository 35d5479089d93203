"""What became of each cell, in a word and a reason."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import polars as pl

    from .source import Case

#: In the order of what is worse.
STATES = ("failed", "dishonest", "unsolved", "not run", "ok")


def verdict(case: Case, record: dict[str, Any] | None, ticks: pl.DataFrame | None) -> tuple[str, str]:
    """State of a cell, one of `STATES`, and why it isn't ok.

    Parameters
    ----------
    case : Case
    record : dict or None
        Its flat record.
    ticks : pl.DataFrame or None
        Its accuracy part.
    """
    if case.outcome.failed:
        return "failed", case.outcome.failed
    if case.outcome.accuracy is None or record is None or ticks is None:
        return "not run", "the sweep has not come to it"
    false = record["false_solved"], record["false_unsolvable"]
    if any(false):
        claims = ("claimed to have solved what it had not", "claimed to be unsolvable what is not")
        told = [f"{claim} at {_percent(share)} of ticks" for claim, share in zip(claims, false, strict=True) if share]
        return "dishonest", "; ".join(told) + _first(case, ticks)
    if record["success"] < 1.0:
        wrong = ticks.filter(ticks["status"] != case.scenario.expects.value)["status"].to_list()
        counted = ", ".join(f"{status} {count} times" for status, count in Counter(wrong).most_common())
        return "unsolved", f"right at {_percent(record['success'])} of ticks: {counted}" + _first(case, ticks)
    return "ok", ""


def _percent(share: float) -> str:
    # 99.99 % must not be rounded to all of them, nor 0.01 % to none.
    text = f"{100.0 * share:.3g}"
    return f"{text if text != '100' or share == 1.0 else '>99.9'} %"


def _first(case: Case, ticks: pl.DataFrame) -> str:
    """Say where it first went wrong."""
    wrong = ticks.filter(ticks["status"] != case.scenario.expects.value)
    if not len(wrong):
        return ""
    t, message = float(wrong["t"][0]), str(wrong["message"][0]) if "message" in wrong.columns else ""
    where = f"state {round(t / case.scenario.dt)}" if case.scenario.states is not None else f"t = {t:.3f} s"
    return f". First at {where}" + (f": {message}" if message else "")
