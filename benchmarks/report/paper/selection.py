"""Which of a sweep's cells a paper's figures show."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..source import Case

# More panels than this can't be read on one page.
_FORMULATIONS: Final = 2
_SOLVERS: Final = 4


@dataclass(frozen=True)
class Selection:
    """What figures show; what is left empty is chosen.

    Attributes
    ----------
    scenarios : tuple of str
        All without.
    formulations : tuple of str
        And baselines. Without: the thesis's two where the sweep has them, or its first two.
    solvers : tuple of str
        Without: the sweep's first four.
    start : str
        How they start.
    """

    scenarios: tuple[str, ...] = ()
    formulations: tuple[str, ...] = ()
    solvers: tuple[str, ...] = ()
    start: str = "cold"

    def check(self, cases: Sequence[Case]) -> None:
        """Raise ValueError where a name is not in the sweep."""
        for what, wanted in (
            ("scenario", self.scenarios),
            ("formulation", self.formulations),
            ("solver", self.solvers),
            ("start", (self.start,)),
        ):
            solved = [case for case in cases if not case.cell.is_baseline]
            some = solved if what in ("solver", "start") else cases
            there = list(dict.fromkeys(getattr(case.cell, what) for case in some))
            if what == "start" and not there:
                continue  # baselines alone, which have none
            for name in wanted:
                if name not in there:
                    raise ValueError(f"{what}: expected one of the sweep's ({', '.join(there)}), got {name!r}")

    def of(self, cases: Sequence[Case]) -> Selection:
        """Fill in what was left empty."""
        solved = [case for case in cases if not case.cell.is_baseline]
        names = {
            "scenario": list(dict.fromkeys(case.cell.scenario for case in cases)),
            "formulation": list(dict.fromkeys(case.cell.formulation for case in solved or cases)),
            "solver": list(dict.fromkeys(case.cell.solver for case in solved)),
        }
        thesis = [name for name in ("cartesian-error", "joint-space") if name in names["formulation"]]
        return Selection(
            self.scenarios or tuple(names["scenario"]),
            self.formulations
            or tuple([*thesis, *(n for n in names["formulation"] if n not in thesis)][:_FORMULATIONS]),
            self.solvers or tuple(names["solver"][:_SOLVERS]),
            self.start,
        )
