"""Every way the active set can go, followed to its end: how many steps it can take, proved."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from .cone import NEAR, Condition, Decider, Tally, margin
from .exact import direction

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from .exact import Form
    from .method import Decision, DualMethod, Side, Sides

# Longer than any path can be is not known; longer than this is a mistake.
_CAP: Final = 400


@dataclass(frozen=True)
class Region:
    """The theta of one path, from start to end.

    Attributes
    ----------
    iterations : int
        Steps of the path.
    active : tuple of (int, int)
        Sides at the end: row, and -1 or +1.
    conditions : tuple of Condition
        That the path is taken under.
    theta : tuple of int
        One that takes it, up to its length.
    """

    iterations: int
    active: Sides
    conditions: tuple[Condition, ...]
    theta: Form

    @property
    def margin(self) -> float:
        """Distance of theta, at length 1, from where the region ends [-]."""
        return margin(self.conditions, direction(self.theta))


@dataclass(frozen=True)
class Enumeration:
    """All regions, which together hold every theta that was asked for, each once.

    Attributes
    ----------
    regions : tuple of Region
    tally : Tally
        How it was decided what exists.
    """

    regions: tuple[Region, ...]
    tally: Tally

    @property
    def iterations(self) -> int:
        """The most steps, ties included: regions without an inside."""
        return max(region.iterations for region in self.regions)

    @property
    def worst(self) -> Region:
        """Of the regions wider than rounding the one of most steps; of several, the widest."""
        wide = [(region.iterations, region.margin, index) for index, region in enumerate(self.regions)]
        return self.regions[max(entry for entry in wide if entry[1] > NEAR)[2]]

    @property
    def counts(self) -> dict[int, int]:
        """Regions by steps."""
        return dict(sorted(Counter(region.iterations for region in self.regions).items()))


@dataclass(frozen=True)
class _Node:
    active: Sides
    entering: Side | None
    steps: int
    conditions: tuple[Condition, ...]
    theta: Form


def united(parts: Sequence[Enumeration]) -> Enumeration:
    """Give the regions of several enumerations as one: those of different pieces of a slice."""
    tally = Tally()
    for part in parts:
        tally += part.tally
    return Enumeration(tuple(region for part in parts for region in part.regions), tally)


def enumerate_paths(
    method: DualMethod,
    given: Sequence[Condition],
    on_progress: Callable[[int, int, float], None] | None = None,
) -> Enumeration:
    """Follow every path that some theta takes.

    Parameters
    ----------
    method : DualMethod
    given : sequence of Condition
        Which theta are asked for.
    on_progress : callable, optional
        Told the regions found, the most steps so far, and the share done, as far as can be told.

    Raises
    ------
    ValueError
        When no theta satisfies what is given.
    DependentRowsError
        When rounding would decide.
    """
    decider = Decider()
    start = decider.witness((), given)
    if start is None:
        raise ValueError("given: expected conditions that can be satisfied together")
    stack = [(_Node((), None, 0, tuple(given), start), 1.0)]
    regions: list[Region] = []
    most, done = 0, 0.0
    while stack:
        node, share = stack.pop()
        if node.steps > _CAP:
            raise RuntimeError(f"expected an end within {_CAP} steps, got none: {node.active}")
        children = _after(node, method, decider)
        for decision, child in children:
            if decision.steps == 0 and decision.entering is None:
                regions.append(Region(child.steps, child.active, child.conditions, child.theta))
                most, done = max(most, child.steps), done + share / len(children)
            else:
                stack.append((child, share / len(children)))
        if on_progress is not None:
            on_progress(len(regions), most, done)
    return Enumeration(tuple(regions), decider.tally)


def _after(node: _Node, method: DualMethod, decider: Decider) -> list[tuple[Decision, _Node]]:
    """What can happen at a node; the others are proved not to."""
    found, known, taken = [], set(node.conditions), 0
    for decision in method.decisions(node.active, node.entering):
        new = [condition for condition in decision.conditions if condition not in known]
        theta: Form | None = node.theta
        if all(condition.holds(node.theta) for condition in new):
            taken += 1
        else:
            theta = decider.witness(node.conditions, new)
        if theta is not None:
            steps = node.steps + decision.steps
            conditions = (*node.conditions, *new)
            found.append((decision, _Node(decision.active, decision.entering, steps, conditions, theta)))
    if taken != 1:
        raise AssertionError(f"expected a theta to take one decision, got {taken}, at {node.active}, {node.entering}")
    return found


def follow(method: DualMethod, theta: Form, tolerance: float = 0.0) -> tuple[int, Sides]:
    """Give the steps of one theta and the sides active at the end, exactly.

    Parameters
    ----------
    method : DualMethod
    theta : tuple of int
    tolerance : float
        Rows hold if no farther away than this share of |v|, as in the C code once a row has entered: whether one has
        to is asked without a tolerance there [-].

    Raises
    ------
    DependentRowsError
        When rounding would decide.
    """
    active: Sides = ()
    entering: Side | None = None
    steps = 0
    while True:
        options = method.decisions(active, entering)
        taken = next(each for each in options if all(condition.holds(theta) for condition in each.conditions))
        if taken.steps == 0 and taken.entering is None:
            return steps, active
        if steps and not taken.steps and taken.entering and method.distance(active, taken.entering, theta) <= tolerance:
            return steps, active
        active, entering, steps = taken.active, taken.entering, steps + taken.steps
