"""
Robots by name.

A robot of this library is one file and one line in `_BUILT_IN`. A robot from outside is an entry point in the
group `kinqp.robots`, or `module:attribute` given as the name; either names a callable `(*, tip, qdd_max) ->
Robot`.
"""

from __future__ import annotations

import difflib
import importlib
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, Protocol

from .davinci5 import davinci5
from .errors import RobotError
from .robot import Robot
from .urdf import robot_from_urdf

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

ENTRY_POINT_GROUP: Final = "kinqp.robots"


class RobotBuilder(Protocol):
    """What a registered name stands for."""

    def __call__(self, *, tip: str | None, qdd_max: ArrayLike | None) -> Robot:
        """Build the robot; None means the default for both."""
        ...


def _from_data(name: str) -> RobotBuilder:
    def build(*, tip: str | None, qdd_max: ArrayLike | None) -> Robot:
        path = Path(__file__).parent / "data" / f"{name}.urdf"
        return robot_from_urdf(path, name=name, tip=tip, qdd_max=qdd_max)

    return build


_BUILT_IN: Final[Mapping[str, RobotBuilder]] = MappingProxyType(
    {
        "davinci5": davinci5,
        "lbr_med14": _from_data("lbr_med14"),
        "lbr_med7": _from_data("lbr_med7"),
        "ur5e": _from_data("ur5e"),
    }
)


def available_robots() -> tuple[str, ...]:
    """Return the names that `load_robot` knows, sorted: this library's and those of installed packages."""
    return tuple(sorted({*_BUILT_IN, *_plug_ins()}))


def load_robot(
    name_or_path: str | os.PathLike[str],
    *,
    tip: str | None = None,
    qdd_max: ArrayLike | None = None,
) -> Robot:
    """
    Load a robot by name or from a URDF file.

    Parameters
    ----------
    name_or_path
        A name out of `available_robots()`, the path of a URDF file, or `module:attribute` naming a callable
        `(*, tip, qdd_max) -> Robot`.
    tip
        Link at the tool centre point; may be left out where the robot's tree does not branch.
    qdd_max
        Acceleration limits, one for all joints or one each [rad/s^2 or m/s^2]; None for the robot's own,
        which for the arms here and for any URDF is this project's default (10 rad/s^2, 1 m/s^2).

    Returns
    -------
    The robot.

    Raises
    ------
    RobotError
        If there is no such robot or file, or it cannot be used; the message says what to do.
    ValueError
        If `qdd_max` does not fit.
    """
    if not isinstance(name_or_path, str):
        return robot_from_urdf(name_or_path, tip=tip, qdd_max=qdd_max)
    if name_or_path in _BUILT_IN:
        return _BUILT_IN[name_or_path](tip=tip, qdd_max=qdd_max)
    plug_ins = _plug_ins()
    if name_or_path in plug_ins:
        return _checked(plug_ins[name_or_path].load(), name_or_path, tip, qdd_max)
    if _is_path(name_or_path):
        return robot_from_urdf(name_or_path, tip=tip, qdd_max=qdd_max)
    if ":" in name_or_path:
        return _checked(_imported(name_or_path), name_or_path, tip, qdd_max)
    names = available_robots()
    close = difflib.get_close_matches(name_or_path.lower(), names, n=1)
    hint = f"did you mean {close[0]!r}? Available" if close else "available"
    raise RobotError(
        f"robot: expected a known name or the path of a URDF file, got {name_or_path!r}; {hint}: {', '.join(names)}"
    )


def _is_path(text: str) -> bool:
    path = Path(text)
    return path.suffix in (".urdf", ".xml") or len(path.parts) > 1 or path.is_file()


def _plug_ins() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=ENTRY_POINT_GROUP)}


def _imported(text: str) -> object:
    module, _, attribute = text.partition(":")
    try:
        return getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise RobotError(f"robot: expected module:attribute that can be imported, got {text!r} ({error})") from error


def _checked(builder: object, name: str, tip: str | None, qdd_max: ArrayLike | None) -> Robot:
    """Call what an outside package supplied, and make sure that a Robot came back."""
    expected = f"robot: expected {name!r} to name a callable (*, tip, qdd_max) -> Robot"
    if not callable(builder):
        raise RobotError(f"{expected}, got {type(builder).__name__}")
    robot = builder(tip=tip, qdd_max=qdd_max)
    if not isinstance(robot, Robot):
        raise RobotError(f"{expected}, got one that returned {type(robot).__name__}")
    return robot
