"""Values for the settable inputs of a hand-guiding controller: in one of its modes, or in all that have them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..formulations import InputError, check_input
from .checks import checked_modes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from ..formulations import Input, Mode

    Array = NDArray[np.float64]


def index_of_mode(modes: Sequence[Mode], mode: str | Mode) -> int:
    """Find a mode among those that can be engaged.

    Raises
    ------
    ValueError
        When it is none of them.
    """
    name, names = str(checked_modes([mode])[0]), [str(each) for each in modes]
    if name not in names:
        raise ValueError(f"mode: expected one of {', '.join(names)}, got {name!r}")
    return names.index(name)


def checked_values(
    modes: Sequence[Mode],
    specs: Sequence[Mapping[str, Input]],
    mode: str | Mode | None,
    inputs: Mapping[str, ArrayLike],
) -> dict[int, dict[str, Array]]:
    """Check what was given to `set`.

    Parameters
    ----------
    modes : sequence of Mode
        That can be engaged.
    specs : sequence of mapping of str to Input
        What can be set in each of them.
    mode : str or Mode, optional
        Where to set it; None: in all that have it.
    inputs : mapping of str to array_like

    Returns
    -------
    dict of int to dict of str to ndarray
        By the mode's index and the input's name, each of the input's size in that mode.

    Raises
    ------
    InputError
        Naming the input that is unknown, of the wrong shape, not finite or out of range, or not for one mode alone.
    ValueError
        When the mode is none of `modes`.
    """
    if mode is not None and "qd_max" in inputs:
        raise InputError(f"qd_max: expected for all modes at once, got mode {mode}")
    chosen = range(len(modes)) if mode is None else [index_of_mode(modes, mode)]
    for name in inputs:
        if not any(name in specs[index] for index in chosen):
            names = ", ".join(dict.fromkeys(known for index in chosen for known in specs[index]))
            raise InputError(f"{name}: expected an input among {names}, got {name!r}")
    return {
        index: {
            name: np.broadcast_to(check_input(spec, inputs[name], modes[index]), (spec.size,)).copy()
            for name, spec in specs[index].items()
            if name in inputs
        }
        for index in chosen
    }


def check_order(given: Mapping[str, Array], standing: Mapping[str, Array]) -> None:
    """See that position limits that belong together make sense together.

    Parameters
    ----------
    given : mapping of str to ndarray
        New values.
    standing : mapping of str to ndarray
        Those that hold where nothing new is given.

    Raises
    ------
    InputError
        When a lower position limit lies above the upper one.
    """
    low, high = (given.get(name, standing[name]) for name in ("q_min", "q_max"))
    if (low > high).any():
        raise InputError(f"q_min and q_max: expected q_min <= q_max at every joint, got {low} and {high}")
