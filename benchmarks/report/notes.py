"""What a reader must know before believing a report: limitations, conditions, settings."""

from __future__ import annotations

import json
from collections import Counter
from typing import TYPE_CHECKING, Final

from ..metrics import REQUIREMENTS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..manifest import Manifest
    from .source import Case

_ALWAYS: Final = (
    "Closed loops are simulated: joints follow their commands exactly, nothing is measured, and there is no "
    "admittance or human in the "
    "loop.",
    "The reference that commands are compared with is this project's own active set at its tightest, accepted "
    "where its residuals "
    "are below 1e-12. That it agrees with itself says little; that other methods agree with it says that both "
    "are right.",
    "Iterations of different methods are different work: compare their numbers within a method, and times "
    "between methods.",
    "Times through Python hold what a call from Python costs, which is most of the time of the fastest solvers. "
    "They are no worst-case "
    "execution times: the largest of so many samples is that of this machine on that day.",
    "All times are of one machine. Rank solvers by ratios on the same problems, not by seconds from two reports.",
    "Joint acceleration limits of the KUKA arms are this project's choice (10 rad/s²): KUKA publishes none.",
)
_SHOWN: Final = 6


def limitations(manifest: Manifest, cases: Sequence[Case], buckets: int) -> list[str]:
    """Limitations of any report, then those of this one."""
    found = list(_ALWAYS)
    stand_ins = [f"{one.number}" for one in REQUIREMENTS if one.stand_in]
    found.append(
        f"Requirements {', '.join(stand_ins)} can't be measured from a sweep; their columns are the closest that "
        "can, as defined below the "
        "scorecard."
    )
    found.append(
        f"Curves are thinned to {buckets} buckets of neighbouring ticks, of which the smallest and the largest "
        "value are drawn: no spike is "
        "lost, and every point drawn was measured."
    )
    if manifest.conditions.get("timing", "").startswith("not"):
        found.append("The timing process was not pinned to a core.")
    sampled = sorted(
        {case.cell.solver for case in cases if case.outcome.accuracy and case.outcome.accuracy.loop == "sampled"}
    )
    if sampled:
        found.append(
            "Too slow for closed loops of their own, and asked some of the reference's states instead: "
            f"{', '.join(sampled)}. "
            "They have no accelerations and no phase plots."
        )
    restless = [str(case.cell) for case in cases if case.outcome.timing and not case.outcome.timing.deterministic]
    if restless:
        found.append(f"Gave different answers to the same problem in different repeats: {_some(restless)}.")
    untimed = [str(case.cell) for case in cases if case.outcome.accuracy and case.outcome.timing is None]
    if untimed:
        found.append(f"Not timed yet: {_some(untimed)}.")
    notes = Counter(
        ("baselines" if case.cell.is_baseline else case.cell.solver, note)
        for case in cases
        if case.outcome.timing
        for note in case.outcome.timing.notes
    )
    found += [f"{solver}: {note}." for solver, note in sorted(notes)]
    return found + [f"Left out of the sweep: {what}: {why}." for what, why in manifest.skipped.items()]


def settings(manifest: Manifest) -> str:
    """The sweep's configuration, as JSON."""
    return json.dumps(manifest.config.model_dump(mode="json"), indent=2)


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(names[:_SHOWN]) + more
