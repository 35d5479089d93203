"""What was proved, as a file that can be checked again: by the compiled tick and by exact arithmetic."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from time import process_time
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ...codegen import compile_step
from ...control import InterpretedStep
from ...formulations import Mode, get_formulation
from ...robots import load_robot
from ...solvers import get_solver
from ..store import write_whole
from ..worst_case.case import CaseError
from .agreement import Agreement, compare
from .cone import rounded
from .enumeration import follow
from .exact import direction
from .slices import Slice

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from ...codegen import CompiledStep

_KIND: Final = "kinqp certificates"


@dataclass(frozen=True)
class Attained:
    """A tick of most iterations: as many as the bound allows, unless only ties take those.

    Attributes
    ----------
    v : list of float
        The hand [m/s, rad/s].
    limits : dict of str to list of float
        Run-time inputs.
    proved, compiled : int
        Iterations of its region, and of the compiled tick.
    margin : float
        Distance from where its region ends, at |theta| = 1 [-].
    """

    v: list[float]
    limits: dict[str, list[float]]
    proved: int
    compiled: int
    margin: float


@dataclass(frozen=True)
class Certificate:
    """Bound of one slice.

    Attributes
    ----------
    q : list of float
        State [rad or m].
    limits : dict of str to list of float
        Run-time inputs in place of the robot's own limits.
    free : list of str
        Sides whose bound is a parameter, as 3:lower.
    speed : float or None
        Of the hand, at most, along each axis [m/s, rad/s]; None: any.
    iterations : int
        No theta of the slice takes more, ties and all.
    attained : Attained
    regions : dict of str to int
        Regions by iterations.
    proved : dict of str to int
        How it was decided what exists; see `Tally`.
    agreement : Agreement
        With the compiled tick.
    seconds : float
        CPU time of the proof [s].
    """

    q: list[float]
    limits: dict[str, list[float]]
    free: list[str]
    speed: float | None
    iterations: int
    attained: Attained
    regions: dict[str, int]
    proved: dict[str, int]
    agreement: Agreement
    seconds: float


@dataclass(frozen=True)
class Certificates:
    """Bounds of slices of one robot in one mode.

    Attributes
    ----------
    robot, formulation, mode : str
    tip : str or None
        Frame at the tool centre point, where the robot is a URDF that branches.
    certificates : list of Certificate
    refused : list of dict
        States that rounding decides: `q`, `limits`, `reason`.
    conditions : dict of str to str
        Machine and versions.
    """

    robot: str
    tip: str | None
    formulation: str
    mode: str
    certificates: list[Certificate]
    refused: list[dict[str, Any]]
    conditions: dict[str, str]


def certify(
    slice_: Slice,
    step: CompiledStep,
    *,
    samples: int = 2,
    seed: int = 0,
    on_progress: Callable[[int, int, float], None] | None = None,
) -> Certificate:
    """Bound the iterations of a slice, and run the compiled tick in each of its regions.

    Parameters
    ----------
    slice_ : Slice
    step : CompiledStep
        Of the same formulation, robot and mode.
    samples, seed : int
        See `compare`.
    on_progress : callable, optional
        See `enumerate_paths`.

    Raises
    ------
    DependentRowsError
        When rounding would decide.
    """
    start = process_time()
    found = slice_.enumerate(on_progress)
    seconds = process_time() - start
    worst = found.worst
    v, inputs = slice_.inputs(direction(worst.theta))
    limits = {name: np.atleast_1d(value).tolist() for name, value in inputs.items()}
    attained = Attained(v.tolist(), limits, worst.iterations, step(slice_.q, v, **inputs).iterations, worst.margin)
    return Certificate(
        q=slice_.q.tolist(),
        limits={name: np.atleast_1d(value).tolist() for name, value in slice_.limits.items()},
        free=[f"{joint}:{'lower' if sign < 0 else 'upper'}" for joint, sign in slice_.free],
        speed=slice_.speed,
        iterations=found.iterations,
        attained=attained,
        regions={str(steps): count for steps, count in found.counts.items()},
        proved=asdict(found.tally),
        agreement=compare(step, slice_, found.regions, samples, seed),
        seconds=seconds,
    )


def attained_again(found: Certificates) -> list[tuple[int, int]]:
    """Run the ticks that attain the bounds again: iterations of the compiled tick, and in exact arithmetic.

    Raises
    ------
    DependentRowsError
        When rounding would decide.
    """
    robot = load_robot(found.robot, tip=found.tip)
    compiled = compile_step(robot, found.formulation, found.mode)
    interpreted = InterpretedStep(
        robot, get_formulation(found.formulation), Mode.parse(found.mode), get_solver("active-set")
    )
    counts = []
    for each in found.certificates:
        q, v = np.array(each.q), np.array(each.attained.v)
        limits = {name: np.array(values) for name, values in each.attained.limits.items()}
        theta = rounded(np.append(v, 1.0))
        exact, _ = follow(Slice(interpreted, q, limits).method(theta), theta)
        counts.append((compiled(q, v, **limits).iterations, exact))
    return counts


def write_certificates(found: Certificates, path: Path) -> None:
    """Write as JSON, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, (json.dumps({"kind": _KIND, **asdict(found)}, indent=1) + "\n").encode())


def read_certificates(path: Path) -> Certificates:
    """Read what `write_certificates` wrote.

    Raises
    ------
    CaseError
        Naming the file, when it isn't such.
    """
    expected = f"{path}: expected a file that kinqp certify has written"
    try:
        given: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        if given.pop("kind") != _KIND:
            raise CaseError(expected)
        certificates = [
            Certificate(**{**x, "attained": Attained(**x["attained"]), "agreement": Agreement(**x["agreement"])})
            for x in given["certificates"]
        ]
        return Certificates(**{**given, "certificates": certificates})
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise CaseError(f"{expected}: {error}") from error
