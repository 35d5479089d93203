"""A robot from a URDF file: one chain of it, read by pinocchio, no meshes needed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pinocchio as pin

from .assembly import robot_from_model
from .errors import RobotError
from .urdf_tree import check_joint, check_length, choose_tip, read_tree

if TYPE_CHECKING:
    import os

    from numpy.typing import ArrayLike

    from .robot import Robot


def robot_from_urdf(
    path: str | os.PathLike[str],
    *,
    name: str | None = None,
    tip: str | None = None,
    qdd_max: ArrayLike | None = None,
) -> Robot:
    """
    Load the chain from base to tip of a URDF file; joints off the chain are locked at neutral.

    Parameters
    ----------
    path
        The file.
    name
        Name of the robot; by default the one in the file, or else the file's stem.
    tip
        Link at the tool centre point; may be left out where the tree does not branch.
    qdd_max
        Acceleration limits, one for all joints or one each [rad/s^2 or m/s^2]; URDF has none, so the default
        is this project's (see `limits`).

    Returns
    -------
    The robot; the file's root link is its base frame.

    Raises
    ------
    RobotError
        If the file is missing or not a URDF, the tip is unknown or ambiguous, or a joint on the chain has no
        limits or is of a kind that cannot be controlled.
    ValueError
        If `qdd_max` does not fit.
    """
    file = Path(path).expanduser()
    source = str(file)
    try:
        text = file.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise RobotError(f"{source}: expected a URDF file, got no such file; check the path") from error
    except (OSError, UnicodeDecodeError) as error:
        raise RobotError(f"{source}: expected a readable URDF file, got {error}; check the file") from error
    tree = read_tree(text, source)
    tip = choose_tip(tree, tip)
    chain = tree.chain(tip)
    check_length(chain, source)
    for joint in chain:
        check_joint(joint)
    try:
        model = _chain_model(text, {joint.name for joint in chain if joint.kind != "fixed"})
    except (ValueError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        raise RobotError(f"{source}: expected a URDF file, got one that pinocchio rejects ({reason})") from error
    model.name = name or tree.name or file.stem
    return robot_from_model(model.name, tip, model, qdd_max)


def _chain_model(text: str, moving: set[str]) -> Any:
    """Read a file into a `pin.Model` in which all joints but these are locked at neutral."""
    model = pin.buildModelFromXML(text)
    locked = [index for index, name in enumerate(model.names) if index > 0 and name not in moving]
    return pin.buildReducedModel(model, locked, pin.neutral(model))
