"""What the table of all cells shows of a record, in words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from ..metrics import REQUIREMENTS
from .series import CLOCKS

Format = Literal["number", "us", "percent", "int"]


@dataclass(frozen=True)
class Column:
    """A column of the table.

    Attributes
    ----------
    key : str
        Of the flat record.
    label, unit : str
        As headed; the unit is that of what is shown.
    group : str
        Which columns are shown together.
    format : {"number", "us", "percent", "int"}
        Seconds shown as microseconds, shares as per cent.
    help : str
        Definition.
    bad_above : float or None
        A value above this is marked, as stored.
    """

    key: str
    label: str
    unit: str
    group: str
    format: Format
    help: str
    bad_above: float | None = None


_SPREAD: Final = (
    ("p50", "p50", "Median."),
    ("p95", "p95", "95th percentile."),
    ("p99", "p99", "99th percentile."),
    ("p999", "p99.9", "99.9th percentile."),
    ("max", "max", "Largest seen; the machine's other business more often than the solver's."),
)
_MAIN: Final = (
    Column("success", "right", "%", "main", "percent", "Ticks with the right answer by residuals that we compute."),
    Column("false_solved", "false solved", "%", "main", "percent",
           "Ticks at which the solver claimed to have solved the problem, and had not: its honesty.", 0.0),
    Column("wall_p50", "time p50", "µs", "main", "us", "Median of update and solve through Python."),
    Column("wall_p99", "time p99", "µs", "main", "us", "99th percentile of update and solve through Python."),
    Column("wall_late_1khz", "late at 1 kHz", "%", "main", "percent",
           "Solves through Python that took longer than 1 ms."),
    Column("iterations_mean", "iter. mean", "", "main", "number", "Iterations per tick as the solver counts them."),
    Column("iterations_max", "iter. max", "", "main", "int", "Most iterations of any tick."),
    Column("peak_acceleration", "peak accel.", "of limit", "main", "number",
           "Largest joint acceleration over its limit, of all joints."),
    Column("against", "against hand", "ticks", "main", "int",
           "Ticks at which the tool moves against the hand: v . (v + eps) < 0.", 0.0),
    Column("task_scale_loss", "pull lost", "%", "main", "percent",
           "Mean share of the hand's velocity that is not made, while it pulls."),
    Column("reference_error_max", "off reference", "rad/s", "main", "number",
           "Largest difference of a command from the reference's for the same problem [rad/s or m/s]."),
)  # fmt: skip
_ITERATIONS: Final = (
    Column("iterations_mean", "mean", "", "iterations", "number", "Iterations per tick."),
    Column("iterations_p99", "p99", "", "iterations", "int", "99th percentile of iterations per tick."),
    Column("iterations_max", "max", "", "iterations", "int", "Most iterations of any tick."),
    Column("changes_mean", "set changes", "per tick", "iterations", "number",
           "Rows that joined or left the active set from one tick to the next, mean."),
    Column("changes_max", "set changes max", "", "iterations", "int", "Most such rows at once."),
)  # fmt: skip
_ANSWERS: Final = (
    Column("success", "right", "%", "answers", "percent", "Ticks with the right answer by residuals that we compute."),
    Column("false_solved", "false solved", "%", "answers", "percent", "Claimed solved, and was not.", 0.0),
    Column("false_unsolvable", "false unsolvable", "%", "answers", "percent",
           "Claimed to have no solution, where there is one.", 0.0),
    Column("gave_up", "gave up", "%", "answers", "percent", "Ended without an answer, and said so."),
    Column("agreement", "agrees", "%", "answers", "percent",
           "Commands that agree with the reference, of those compared."),
    Column("compared", "compared", "%", "answers", "percent", "Ticks with a reference to compare with."),
    Column("reference_error_p99", "off reference p99", "rad/s", "answers", "number",
           "99th percentile of the difference."),
    Column("reference_error_max", "off reference max", "rad/s", "answers", "number",
           "Largest difference of a command."),
)  # fmt: skip
_ERRORS: Final = (
    Column("proposed_excess", "over bound", "rad/s", "errors", "number",
           "Largest excess over a joint's velocity bound of what the solver proposed, refused proposals included."),
    Column("sent_excess", "sent over bound", "rad/s", "errors", "number", "The same of what was sent."),
    Column("proposed_fixed_error", "locked rows", "m/s, rad/s", "errors", "number",
           "Largest error of a locked row of what the solver proposed."),
    Column("off_line", "off the line", "m/s", "errors", "number", "Largest velocity sent along a locked translation."),
    Column("off_orientation", "off orientation", "rad/s", "errors", "number",
           "Largest velocity sent about a locked axis."),
    Column("drift_offset", "drift", "m", "errors", "number",
           "Furthest that the tool was from what its mode locks, since the mode began."),
    Column("drift_turn", "drift", "rad", "errors", "number", "The same of its orientation."),
    Column("not_finite", "not finite", "%", "errors", "percent", "Ticks whose proposal was not finite.", 0.0),
    Column("task_error_linear", "task error", "m/s", "errors", "number",
           "Mean norm of the Cartesian error, translations."),
    Column("task_error_angular", "task error", "rad/s", "errors", "number",
           "Mean norm of the Cartesian error, rotations."),
    Column("time_lost", "time lost", "s", "errors", "number", "How far the tool is behind the hand in the end."),
)  # fmt: skip
_MOTION: Final = (
    Column("peak_speed", "peak speed", "of limit", "motion", "number", "Largest joint velocity over its limit."),
    Column("peak_acceleration", "peak accel.", "of limit", "motion", "number",
           "Largest joint acceleration over its limit."),
    Column("watched_acceleration", "of watched", "of limit", "motion", "number", "The same of the watched joints."),
    Column("limit_overshoot", "overshoot", "rad", "motion", "number",
           "Furthest that a joint went beyond a position limit."),
    Column("on_limit", "on limit", "%", "motion", "percent", "Ticks with a watched joint within 1e-6 of a limit."),
    Column("closest", "closest", "rad", "motion", "number", "Smallest distance of a watched joint to a limit."),
    Column("chatter", "chatter", "1/s", "motion", "number",
           "Sign changes of joint accelerations with both sides above 1 % of the limit."),
    Column("jumps", "jumps", "1/s", "motion", "number",
           "Ticks at which a joint's command changes by more than 2 qdd_max dt."),
    Column("sigma_min", "\u03c3 min", "", "motion", "number", "Smallest singular value of the guided rows met."),
)  # fmt: skip
_HAND: Final = (
    Column("against", "against hand", "ticks", "hand", "int",
           "Ticks at which the tool moves against the hand: v . (v + eps) < 0.", 0.0),
    Column("against_speed", "speed", "m/s, rad/s", "hand", "number", "Largest speed against the hand."),
    Column("against_share", "share", "%", "hand", "percent", "The same over the hand's speed, while it pulls."),
    Column("against_correction", "correcting", "ticks", "hand", "int", "While the locked rows are to move."),
    Column("against_stop", "stopping", "ticks", "hand", "int", "Of the rest, with the safe stop."),
    Column("against_limit", "braking hard", "ticks", "hand", "int",
           "Of the rest, slower than before, a joint at its acceleration limit."),
    Column("against_slowing", "braking gently", "ticks", "hand", "int", "Slower than before, no joint at that limit."),
    Column("against_choice", "of its own", "ticks", "hand", "int", "All others: new, or growing.", 0.0),
)  # fmt: skip


def _times() -> tuple[Column, ...]:
    made = []
    for clock, text in CLOCKS.items():
        group = f"time: {text}"
        made += [
            Column(f"{clock}_{key}", label, "µs", group, "us", f"{help_} Clock: {text}.")
            for key, label, help_ in _SPREAD
        ]
        for key, rate in (("late_1khz", "1 kHz"), ("late_4khz", "4 kHz")):
            made.append(
                Column(
                    f"{clock}_{key}",
                    f"late at {rate}",
                    "%",
                    group,
                    "percent",
                    f"Solves longer than the period at {rate}. Clock: {text}.",
                )
            )
        made.append(Column(f"{clock}_samples", "samples", "", group, "int", f"Solves timed. Clock: {text}."))
    apart = (("setup_p50", "set-up"), ("update_p50", "update"), ("solve_p50", "solve"))
    made += [
        Column(key, f"{label} p50", "µs", "time: apart", "us", f"Median of the {label} alone, through Python.")
        for key, label in apart
    ]
    made += [
        Column(
            f"{key[:-3]}p99",
            f"{label} p99",
            "µs",
            "time: apart",
            "us",
            f"99th percentile of the {label} alone, through Python.",
        )
        for key, label in apart
    ]
    return tuple(made)


def _requirements() -> tuple[Column, ...]:
    return tuple(
        Column(f"requirement_{one.key}", f"{one.number}. {one.key.replace('_', ' ')}", one.unit.strip("-"),
           "requirements",
               "number",
               f"{one.text}: {one.definition}.", None if one.at_least else one.threshold)
        for one in REQUIREMENTS
    )  # fmt: skip


COLUMNS: Final = (*_MAIN, *_times(), *_ITERATIONS, *_ANSWERS, *_ERRORS, *_MOTION, *_HAND, *_requirements())
