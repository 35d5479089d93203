"""Checks of the options that solvers take."""

from __future__ import annotations

import difflib
import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping


class OptionError(ValueError):
    """An option has a value that a solver cannot work with."""


class UnknownOptionError(TypeError):
    """An option does not exist."""


def positive(name: str, value: float) -> float:
    """Return `value` as a float if it is a finite positive number, else raise `OptionError`."""
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float | np.integer | np.floating)
        or not (0.0 < value < math.inf)
    ):
        raise OptionError(f"{name} must be a positive number, but is {value!r}.")
    return float(value)


def gap_tolerance(tolerance: float) -> float:
    """Return the duality gap to ask of an interior-point method so that x itself is good to `tolerance`.

    A gap of d leaves x within sqrt(2 d / s) of the minimiser where the smallest curvature is s: the gap must be the
    tolerance squared. Below 1e-12 rounding stops such methods first.
    """
    return max(tolerance**2, 1e-12)


def count(name: str, value: int) -> int:
    """Return `value` as an int if it is an integer, of Python or NumPy, of at least 1, else raise `OptionError`."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 1:
        raise OptionError(f"{name} must be an integer of at least 1, but is {value!r}.")
    return int(value)


def flag(name: str, value: object) -> bool:
    """Return `value` if it is true or false, also as 1 or 0 or in words, else raise `OptionError`."""
    choice = {"true": True, "1": True, "false": False, "0": False}.get(str(value).lower())
    if choice is None:
        raise OptionError(f"{name} must be true or false, but is {value!r}.")
    return choice


def unknown(what: str, name: str, choices: Iterable[str]) -> str:
    """Write the sentence that rejects a name, with the choices and, if there is one, the likely intention."""
    names = sorted(choices)
    return f"{what} {name!r} does not exist{hint(name, names)}; the choices are {', '.join(names) or 'none'}."


def hint(name: str, choices: Iterable[str]) -> str:
    """Write the likely intention behind a wrong name, upper and lower case aside; empty where there is none."""
    folded = {choice.casefold(): choice for choice in choices}
    close = difflib.get_close_matches(name.casefold(), folded, n=1)
    return f" (did you mean {folded[close[0]]!r}?)" if close else ""


def apply_settings(solver: str, target: object, settings: Mapping[str, object]) -> None:
    """Set attributes of a backend's own settings object.

    Raises
    ------
    UnknownOptionError
        When the backend has no setting of that name.
    OptionError
        When the backend does not accept the value.
    """
    names = [name for name in dir(target) if not name.startswith("_")]
    for name, value in settings.items():
        if name not in names:
            raise UnknownOptionError(unknown(f"Setting of {solver}", name, names))
        try:
            setattr(target, name, value)
        except (TypeError, ValueError) as error:
            raise OptionError(f"{solver} does not accept {value!r} for its setting {name}: {error}.") from error


def tried(solver: str, settings: Mapping[str, object], attempt: Callable[[], object]) -> None:
    """Refuse settings with which a backend cannot be called, where it does not say beforehand which ones it has.

    Raises
    ------
    OptionError
        With the backend's own words.
    """
    try:
        attempt()
    except Exception as error:
        raise OptionError(f"{solver} does not accept the settings {dict(settings)}: {one_line(error)}") from error


def one_line(error: Exception) -> str:
    """Return what an exception says, on one line."""
    return " ".join(str(error).split()) or type(error).__name__
