"""Motion modes: which rows of the tool's twist the hand guides, and which the mode locks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Literal

import casadi as ca
import numpy as np

from ..robots import real_array

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

Frame = Literal["world", "tool"]
_TRANSLATIONS: Final = (0, 1, 2)
_ROTATIONS: Final = (3, 4, 5)
_ALL: Final = _TRANSLATIONS + _ROTATIONS
_AXES: Final = ("x", "y", "z")


class ModeError(ValueError):
    """A motion mode was asked for that does not exist or does not make sense."""


@dataclass(frozen=True)
class Mode:
    """Which rows of the twist are free, which are fixed, and in which frame they are counted.

    The six rows of the mode's twist are three translations [m/s] and three rotations [rad/s] along the mode's
    axes, the translations taken at the tool centre point, or at the pivot for `rcm`. Rows that are neither free
    nor fixed are left to the redundancy. ``docs/modes.md`` draws every mode.

    Parameters
    ----------
    name : str
        As written on the command line, without its argument.
    free_rows, fixed_rows : tuple of int
        Rows of the mode's twist that the hand guides, and that the mode locks: 0-2 translations, 3-5 rotations.
    frame : {"world", "tool"}
        What `axes` is expressed in.
    axes : tuple of 3 tuples of 3 float
        The mode's axes as the rows of a rotation matrix, in `frame`.
    axis_names : tuple of 3 str
        What the axes are called in messages and reports.
    depth : float
        Signed distance from the tool centre point to the pivot along the tool's z [m]; non-zero for `rcm` only.
    argument : str
        The mode's argument as written on the command line.

    Notes
    -----
    Sources: thesis 2.1 and 4.2 (fix orientation, fix position, z-axis); selection-matrix equalities and remote
    centre of motion as in the shared-control drilling robot, "Equality Constraints".
    """

    name: str
    free_rows: tuple[int, ...]
    fixed_rows: tuple[int, ...]
    frame: Frame = "world"
    axes: tuple[tuple[float, ...], ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    axis_names: tuple[str, ...] = _AXES
    depth: float = 0.0
    argument: str = ""

    @staticmethod
    def free(frame: Frame = "world") -> Mode:
        """Guide all six rows; none is locked."""
        return Mode("free", _ALL, (), _checked_frame(frame))

    @staticmethod
    def position(frame: Frame = "world") -> Mode:
        """Guide the three translations; the orientation is left to the redundancy."""
        return Mode("position", _TRANSLATIONS, (), _checked_frame(frame))

    @staticmethod
    def fix_orientation(frame: Frame = "world") -> Mode:
        """Guide the three translations and lock the three rotations."""
        return Mode("fix-orientation", _TRANSLATIONS, _ROTATIONS, _checked_frame(frame))

    @staticmethod
    def fix_position(frame: Frame = "world") -> Mode:
        """Guide the three rotations and lock the three translations of the tool centre point."""
        return Mode("fix-position", _ROTATIONS, _TRANSLATIONS, _checked_frame(frame))

    @staticmethod
    def line(axis: str = "z", frame: Frame = "tool") -> Mode:
        """Guide the translation along one axis and lock all else (the thesis's z-axis motion).

        Parameters
        ----------
        axis : {"x", "y", "z"}
            Axis of `frame`.
        frame : {"tool", "world"}
            The tool's axes, unless told otherwise.
        """
        if axis not in _AXES:
            raise ModeError(f"line axis: expected one of x, y, z, got {axis!r}")
        row = _AXES.index(axis)
        fixed = tuple(r for r in _ALL if r != row)
        return Mode("line", (row,), fixed, _checked_frame(frame), argument=axis)

    @staticmethod
    def plane(normal: Sequence[float], frame: Frame = "world") -> Mode:
        """Guide the two translations in a plane; lock the one along its normal and the three rotations.

        Parameters
        ----------
        normal : sequence of 3 float
            Normal of the plane in `frame`, of any length but zero. The two guided axes are the coordinate axis that
            follows the normal's largest component (x, y, z, x, ...), projected into the plane, and the normal's
            cross product with it: for the normal z they are x and y, for y they are z and x.
        """
        n = real_array("plane normal", normal, ModeError)
        if n.shape != (3,) or not np.all(np.isfinite(n)) or not n.any():
            raise ModeError(f"plane normal: expected 3 finite numbers, not all zero, got {normal!r}")
        n = n / np.max(np.abs(n))  # first, so that the norm of a huge or tiny one is neither infinite nor zero
        n = n / np.linalg.norm(n)
        first = np.eye(3)[(int(np.argmax(np.abs(n))) + 1) % 3]
        first = first - n * (n @ first)
        first = first / np.linalg.norm(first)
        axes = tuple(tuple(float(x) for x in row) for row in (first, np.cross(n, first), n))
        text = ",".join(_text(float(x)) for x in normal)
        fixed = (2, *_ROTATIONS)
        return Mode("plane", (0, 1), fixed, _checked_frame(frame), axes, ("1", "2", "n"), argument=text)

    @staticmethod
    def rcm(depth: float) -> Mode:
        """Guide the three rotations about a pivot on the tool's z and the insertion; lock the pivot sideways.

        Parameters
        ----------
        depth : float
            Signed distance from the tool centre point to the pivot along the tool's z [m]: positive lies ahead of
            the tool centre point, negative behind it (a trocar that the tip has passed).
        """
        if isinstance(depth, bool) or not isinstance(depth, (int, float, np.number)) or not np.isfinite(depth):
            raise ModeError(f"rcm depth: expected a finite number of metres, got {depth!r}")
        return Mode("rcm", (2, *_ROTATIONS), (0, 1), "tool", depth=float(depth), argument=_text(float(depth)))

    @staticmethod
    def parse(text: str) -> Mode:
        """Read a mode as written on the command line: `fix-orientation`, `line:z`, `plane:0,1,0`, `rcm:0.1`.

        `@tool` or `@world` behind it names the frame, where the mode takes one: `fix-position@tool`.

        Raises
        ------
        ModeError
            Naming the mode, its argument or its frame, and what was expected.
        """
        body, at, frame = text.strip().partition("@")
        # "line z" is what people say and type.
        body = ":".join(body.split())
        name, colon, argument = body.partition(":")
        if name not in _PARSERS or (at and not frame) or (colon and not argument):
            raise ModeError(f"mode: expected one of {', '.join(_PARSERS)}, got {text!r}")
        options: dict[str, Any] = {"frame": frame} if frame else {}
        if name == "rcm" and frame not in ("", "tool"):
            raise ModeError(f"mode rcm: its frame is always the tool, got {frame!r}")
        if name == "rcm":
            options = {}
        return _PARSERS[name](argument, options)

    def __str__(self) -> str:
        """Write the mode so that `parse` reads it back."""
        default = "tool" if self.name in ("line", "rcm") else "world"
        suffix = "" if self.frame == default else f"@{self.frame}"
        return self.name + (f":{self.argument}" if self.argument else "") + suffix

    @property
    def m_free(self) -> int:
        """Number of guided rows."""
        return len(self.free_rows)

    @property
    def m_fixed(self) -> int:
        """Number of locked rows."""
        return len(self.fixed_rows)

    @property
    def row_names(self) -> tuple[str, ...]:
        """Names of the six rows: `vx` ... `wz`, along the mode's axes."""
        return tuple(f"{letter}{axis}" for letter in "vw" for axis in self.axis_names)

    @property
    def free_names(self) -> tuple[str, ...]:
        """Names of the guided rows, in the order of `v`."""
        return tuple(self.row_names[r] for r in self.free_rows)

    def picture(self) -> str:
        """Draw the rows: `[#]` guided by the hand, `[x]` locked, `[ ]` left to the redundancy."""
        marks = {**dict.fromkeys(self.free_rows, "[#]"), **dict.fromkeys(self.fixed_rows, "[x]")}
        return " ".join(f"{name} {marks.get(row, '[ ]')}" for row, name in enumerate(self.row_names))

    def twist_map(self, pose: ca.SX) -> ca.SX:
        """Matrix that takes the tool's twist to the mode's twist, symbolic.

        Parameters
        ----------
        pose : ca.SX, shape (4, 4)
            Pose of the tool centre point in the world.

        Returns
        -------
        ca.SX, shape (6, 6)
            Acts on (linear, angular) velocity at the tool centre point in world axes [m/s, rad/s].
        """
        rotation = ca.SX(np.array(self.axes))
        if self.frame == "tool":
            rotation = rotation @ pose[:3, :3].T
        lever = -ca.skew(self.depth * pose[:3, 2]) if self.depth else ca.SX(3, 3)
        return ca.sparsify(ca.vertcat(ca.horzcat(rotation, rotation @ lever), ca.horzcat(ca.SX(3, 3), rotation)))

    def twist_map_at(self, pose: Array) -> Array:
        """Give `twist_map` in numbers, shape (6, 6), at `pose`, shape (4, 4)."""
        rotation = np.array(self.axes)
        if self.frame == "tool":
            rotation = rotation @ pose[:3, :3].T
        twist_map = np.zeros((6, 6))
        twist_map[:3, :3] = twist_map[3:, 3:] = rotation
        if self.depth:
            x, y, z = self.depth * pose[:3, 2]
            twist_map[:3, 3:] = rotation @ np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
        return twist_map


def _text(number: float) -> str:
    """Write a number as short as it can be without becoming another one."""
    short = f"{number:g}"
    return short if float(short) == number else repr(number)


def _checked_frame(frame: str) -> Frame:
    if frame == "world":
        return "world"
    if frame == "tool":
        return "tool"
    raise ModeError(f"frame: expected 'world' or 'tool', got {frame!r}")


def _without_argument(make: Callable[..., Mode], argument: str, options: dict[str, Any]) -> Mode:
    mode = make(**options)
    if argument:
        raise ModeError(f"mode {mode.name}: expected no argument, got {argument!r}")
    return mode


def _numbers(mode: str, argument: str, count: int, example: str) -> list[float]:
    try:
        values = [float(part) for part in argument.split(",")]
    except ValueError:
        values = []
    if len(values) != count:
        raise ModeError(f"mode {mode}: expected {count} number(s) as in {example}, got {argument!r}")
    return values


_PARSERS: Final[dict[str, Callable[[str, dict[str, Any]], Mode]]] = {
    "free": lambda argument, options: _without_argument(Mode.free, argument, options),
    "position": lambda argument, options: _without_argument(Mode.position, argument, options),
    "fix-orientation": lambda argument, options: _without_argument(Mode.fix_orientation, argument, options),
    "fix-position": lambda argument, options: _without_argument(Mode.fix_position, argument, options),
    "line": lambda argument, options: Mode.line(argument or "z", **options),
    "plane": lambda argument, options: Mode.plane(_numbers("plane", argument, 3, "plane:0,1,0"), **options),
    "rcm": lambda argument, options: Mode.rcm(_numbers("rcm", argument, 1, "rcm:0.1")[0], **options),
}
MODE_NAMES: Final = tuple(_PARSERS)
