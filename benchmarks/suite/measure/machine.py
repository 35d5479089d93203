"""What was measured on: the machine, its compiler, the versions, the clock."""

from __future__ import annotations

import os
import subprocess
from importlib.metadata import version
from typing import TYPE_CHECKING

from kinqp.benchmarks import conditions
from kinqp.solvers.native import compiler

from .comparison import FORMULATIONS, REPEATS
from .states import MODE, ROBOT, States, arm
from .tick import WHOLE, TimedTick, compiler_flags

if TYPE_CHECKING:
    from collections.abc import Sequence


def machine(flags: Sequence[str], sets: Sequence[States], passes: int) -> str:
    """Say it line by line."""
    found = conditions()
    clock = TimedTick(arm(), FORMULATIONS[0], MODE, sets[0], WHOLE)
    lines = [
        f"{found['cpu']}, {found['cores']} cores, load average {load_average()}; {found['system']}; {found['date']}",
        f"{_compiler()}: {' '.join((compiler_flags(), *flags))}",
        f"Python {found['python']}, numpy {found['numpy']}, daqp {version('daqp')}, pin-pink {version('pin-pink')}",
        f"{ROBOT}, {MODE}; {', '.join(f'{len(s.q)} {s.name}' for s in sets)} states",
        f"{REPEATS} interleaved repeats, minimum of {passes} passes per state",
        f"clock: {clock.cost * clock.unit:.0f} ns, taken off our times; "
        f"clock_gettime: {clock.gettime_cost():.0f} ns, inside the times that DAQP reports",
    ]
    return "\n".join(lines)


def _compiler() -> str:
    answer = subprocess.run([*compiler(), "--version"], capture_output=True, text=True, check=True)
    return answer.stdout.splitlines()[0]


def load_average() -> str:
    """Write the system's load averages."""
    return " ".join(f"{x:.1f}" for x in os.getloadavg())
