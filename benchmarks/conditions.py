"""The conditions of a measurement: machine, versions, clock."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

from ..solvers.native import CompilerError, compiler

_PACKAGES: Final = (
    "kinqp", "numpy", "casadi", "pin", "clarabel", "piqp", "cvxpy", "qpsolvers", "daqp", "highspy", "osqp", "quadprog",
    "scs",
)  # fmt: skip


def conditions() -> dict[str, str]:
    """What a reader must know to judge a time: CPU, cores, system, compiler, versions, git revision, date (UTC)."""
    core = timing_core()
    found = {
        "cpu": _cpu(),
        "cores": str(os.cpu_count()),
        "timing": "not pinned" if core is None else f"pinned to core {core}",
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "compiler": _compiler(),
        "git": _git(),
        "python": platform.python_version(),
    }
    for package in _PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    found["date"] = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    return found


def timing_core() -> int | None:
    """Core to time on, the last that we may use: interrupts mostly go to the first. None: can't be told."""
    return max(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None


def _cpu() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass  # not Linux: the platform's own answer, below
    return platform.processor() or "unknown"


@cache
def _compiler() -> str:
    try:
        answer = subprocess.run([*compiler(), "--version"], capture_output=True, text=True, check=False)
    except (CompilerError, OSError):
        return "none"
    return answer.stdout.partition("\n")[0] or "unknown"


def _git() -> str:
    """Revision of the checkout that the command is run in, where that is one of this project."""
    git = shutil.which("git")
    if git is None:
        return "unknown"

    def ask(*arguments: str) -> str:
        return subprocess.run([git, *arguments], capture_output=True, text=True, check=False).stdout.strip()

    if 'name = "kinqp"' not in ask("show", "HEAD:pyproject.toml"):
        return "unknown"
    return ask("describe", "--always", "--dirty", "--abbrev=12", "--exclude=*") or "unknown"
