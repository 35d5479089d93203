"""Whether the compiled tick does what the proof says: run in every region that was found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from ...solvers import Status
from .cone import NEAR, margin, rounded
from .enumeration import follow
from .exact import direction

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from ...codegen import CompiledStep
    from .enumeration import Region
    from .slices import Slice

    Array = NDArray[np.float64]


#: Share of the hand that the C code takes a row to hold to [-].
TOLERANCE: Final = 1e-12


@dataclass(frozen=True)
class Agreement:
    """Compiled ticks beside what was proved of them.

    Attributes
    ----------
    compared : int
        Ticks compared.
    differing : int
        Those that took another number of iterations, whatever the tolerance.
    tolerated : int
        Of the others, those that took fewer, and as many as exact arithmetic takes until all rows hold to `TOLERANCE`.
    near : int
        Ticks left out, nearer than `NEAR` to where their region ends.
    refused : int
        Ticks that the compiled code did not call solved, with zero motion as its command: it does where `TOLERANCE`, or
        rounding, is more than the 1e-9 rad/s that bounds are checked to, as for hands of hundreds of m/s.
    untouched : int
        Regions of which no tick could be compared: nowhere are they wider than that.
    """

    compared: int
    differing: int
    tolerated: int
    near: int
    refused: int
    untouched: int


def compare(
    step: CompiledStep,
    slice_: Slice,
    regions: Sequence[Region],
    samples: int,
    seed: int,
    on_progress: Callable[[float], None] | None = None,
) -> Agreement:
    """Run the compiled tick at each region's theta and at random ones of the same region.

    Parameters
    ----------
    step : CompiledStep
        Of the slice's formulation, robot and mode.
    slice_ : Slice
    regions : sequence of Region
    samples : int
        Random theta of each region, beside its own.
    seed : int
        Of these.
    on_progress : callable, optional
        Told the share done.
    """
    rng = np.random.default_rng(seed)
    compared = differing = tolerated = near = refused = untouched = 0
    for index, region in enumerate(regions):
        before = compared
        for theta in _inside(region, samples, rng):
            v, inputs = slice_.inputs(theta)
            # Bounds that come about by distances have these distances' rounding.
            met = slice_.theta(v, inputs) if slice_.free else np.append(v, 1.0)
            if margin(region.conditions, met) <= NEAR:
                near += 1
                continue
            tick = step(slice_.q, v, **inputs)
            if tick.status is not Status.SOLVED:
                refused += 1
                continue
            compared += 1
            if tick.iterations != region.iterations:
                whole = rounded(met)
                steps, _ = follow(slice_.method(whole), whole, TOLERANCE)
                tolerated += tick.iterations == steps
                differing += tick.iterations != steps
        untouched += compared == before
        if on_progress is not None:
            on_progress((index + 1) / len(regions))
    return Agreement(compared, differing, tolerated, near, refused, untouched)


def _inside(region: Region, samples: int, rng: np.random.Generator) -> list[Array]:
    """A region's theta, and others by hit and run from there, at |theta| = 1."""
    here = direction(region.theta)
    if margin(region.conditions, here) <= NEAR:
        return []  # thinner than floating point can see
    units = np.array([condition.unit for condition in region.conditions])
    found = [here]
    for _ in range(samples):
        way = rng.normal(size=here.size)
        speed, room = units @ way, units @ here
        # Along here + x way each condition ends at x = -room / speed, ahead where speed is negative.
        with np.errstate(divide="ignore"):
            ends = -room / speed
        ahead = float(np.min(ends, where=speed < 0.0, initial=1.0))
        behind = float(np.max(ends, where=speed > 0.0, initial=-1.0))
        moved = here + rng.uniform(behind, ahead) * way
        here = moved / np.linalg.norm(moved)
        found.append(here)
    return found
