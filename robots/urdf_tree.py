"""
What has to be known of a URDF file before pinocchio reads it: its tree, its joints' kinds, and their limits.

pinocchio fills in zeros or infinities where a file is silent, and reports an unreadable file without saying
why; so the questions "is it there?" and "which links are at the end?" are asked of the XML itself.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass

from .errors import RobotError

_LIMITED = ("revolute", "prismatic")
_SUPPORTED = (*_LIMITED, "continuous", "fixed")
#: More than any machine has that is described in one file, humanoids with both hands included; what pinocchio needs
#: grows with the square of it, in memory and in time.
_MOST_LINKS = 1000
#: Of a joint's origin [m or rad]; beyond, rounding of a position would be visible.
_FARTHEST = 1e6
#: More joints than any arm has. A snake robot has thirty.
_MOST_JOINTS = 100
#: URDF wants axes of length 1. Files hold rounded ones, and (0 0 2); far from 1 it is a slip, and what is left of a
#: direction may be rounding. Beyond 1e-154 and 1e154 squares leave the range of a double.
_AXIS_LENGTHS = (1e-3, 1e3)


@dataclass(frozen=True)
class UrdfJoint:
    """
    A joint as the file has it.

    `origin`, `axis` and `limit` hold the attributes of these elements, None without the element.
    """

    name: str
    kind: str
    parent: str
    child: str
    origin: dict[str, str] | None
    axis: dict[str, str] | None
    limit: dict[str, str] | None
    mimics: str | None


@dataclass(frozen=True)
class UrdfTree:
    """The links and joints of a file; `joint_to` finds the joint that carries a link."""

    name: str
    source: str
    links: tuple[str, ...]
    joint_to: dict[str, UrdfJoint]

    def chain(self, link: str) -> tuple[UrdfJoint, ...]:
        """Return the joints from the root to `link`, fixed ones included, root first."""
        joints: list[UrdfJoint] = []
        seen = set()
        while link in self.joint_to:
            if link in seen:
                raise RobotError(f"{self.source}: expected a tree of links, got a loop through link {link!r}")
            seen.add(link)
            joint = self.joint_to[link]
            joints.append(joint)
            link = joint.parent
        return tuple(reversed(joints))

    def moves(self, link: str) -> bool:
        """Return whether any joint between the root and `link` can move."""
        return any(joint.kind != "fixed" for joint in self.chain(link))

    def ends(self) -> tuple[str, ...]:
        """Return the links that carry no other and can move."""
        parents = {joint.parent for joint in self.joint_to.values()}
        return tuple(link for link in self.links if link not in parents and self.moves(link))


def read_tree(text: str, source: str) -> UrdfTree:
    """
    Read the tree of a URDF file.

    Parameters
    ----------
    text
        The file's content.
    source
        What errors call the file.

    Returns
    -------
    The tree, with every link's carrying joint.

    Raises
    ------
    RobotError
        If the text is not the XML of a URDF, its links are too many, or they are not one tree.
    """
    try:
        root = ET.fromstring(text)  # noqa: S314 - the user's own file, as trusted as code
    except ET.ParseError as error:
        raise RobotError(f"{source}: expected a URDF file, got invalid XML ({error}); check the file") from error
    if root.tag != "robot":
        raise RobotError(f"{source}: expected a URDF file with root element <robot>, got <{root.tag}>")
    if any("xacro}" in element.tag for element in root.iter() if isinstance(element.tag, str)):
        raise RobotError(f"{source}: expected a URDF file, got xacro macros; expand them first with the xacro tool")
    links = tuple(element.get("name", "") for element in root.findall("link"))
    if len(links) > _MOST_LINKS:
        raise RobotError(
            f"{source}: expected at most {_MOST_LINKS} links, got {len(links)}; leave out what is not the arm"
        )
    known = set(links)
    joint_to: dict[str, UrdfJoint] = {}
    for element in root.findall("joint"):
        joint = _read_joint(element)
        for link in (joint.parent, joint.child):
            if link not in known:
                raise RobotError(f"{source}: joint {joint.name!r} expected a link of the file, got {link!r}")
        if joint.child in joint_to:
            raise RobotError(
                f"{source}: expected one joint to carry link {joint.child!r}, "
                f"got {joint_to[joint.child].name!r} and {joint.name!r}"
            )
        joint_to[joint.child] = joint
    roots = [link for link in links if link not in joint_to]
    if len(roots) != 1:
        got = ", ".join(roots) or "none"
        raise RobotError(f"{source}: expected one link that no joint carries, got {got}; connect the links to one tree")
    tree = UrdfTree(root.get("name", ""), source, links, joint_to)
    for link in links:
        tree.chain(link)  # finds a loop that hangs on nothing
    return tree


def _read_joint(element: ET.Element) -> UrdfJoint:
    def child(tag: str, attribute: str) -> str | None:
        found = element.find(tag)
        return None if found is None else found.get(attribute)

    def attributes(tag: str) -> dict[str, str] | None:
        found = element.find(tag)
        return None if found is None else dict(found.attrib)

    return UrdfJoint(
        name=element.get("name", ""),
        kind=element.get("type", ""),
        parent=child("parent", "link") or "",
        child=child("child", "link") or "",
        origin=attributes("origin"),
        axis=attributes("axis"),
        limit=attributes("limit"),
        mimics=child("mimic", "joint"),
    )


def choose_tip(tree: UrdfTree, tip: str | None) -> str:
    """
    Return the link at the tool centre point.

    Parameters
    ----------
    tree
        The file's tree.
    tip
        The link the user named, or None.

    Returns
    -------
    `tip`, or the one end of the tree that can move.

    Raises
    ------
    RobotError
        If there is no such link, or none is named and there are several ends or no moving one, or `tip`
        cannot move.
    """
    ends = tree.ends()
    listed = ", ".join(ends) or "none"
    if tip is None:
        if not ends:
            raise RobotError(f"{tree.source}: expected at least one moving joint, got none between base and any tip")
        if len(ends) > 1:
            raise RobotError(f"tip: expected a link's name because the tree branches, got none; choose one of {listed}")
        return ends[0]
    if tip not in tree.links:
        others = ", ".join(tree.links)
        raise RobotError(f"tip: expected a link of {tree.source}, got {tip!r}; ends: {listed}; all links: {others}")
    if not tree.moves(tip):
        raise RobotError(
            f"tip: expected a link that a joint can move, got {tip!r} "
            f"with no moving joint between base and tip; ends: {listed}"
        )
    return tip


def check_length(chain: tuple[UrdfJoint, ...], source: str) -> None:
    """
    Check that a chain is an arm.

    Raises
    ------
    RobotError
        If more joints move than any arm has.
    """
    moving = sum(joint.kind != "fixed" for joint in chain)
    if moving > _MOST_JOINTS:
        raise RobotError(
            f"{source}: expected at most {_MOST_JOINTS} moving joints between base and tip, got {moving}; "
            "name a tip before the last"
        )


def check_joint(joint: UrdfJoint) -> None:
    """
    Check that a joint on the chain is of a kind this library can control, with the limits it needs.

    Raises
    ------
    RobotError
        If the kind is not supported, the joint mimics another, its origin or axis can't be read or is useless, or
        a limit is missing or useless.
    """
    label = f"joint {joint.name!r}"
    if joint.kind == "floating":
        raise RobotError(f"{label}: expected a base fixed in the world, got a floating joint; make it a fixed joint")
    if joint.kind not in _SUPPORTED:
        raise RobotError(
            f"{label}: expected one of {', '.join(_SUPPORTED)} between base and tip, got {joint.kind!r}; "
            "name a tip before it, or replace it by joints with one axis each"
        )
    _check_origin(label, joint.origin)
    if joint.kind == "fixed":
        return
    if joint.mimics is not None:
        raise RobotError(
            f"{label}: expected an independent joint between base and tip, "
            f"got one that mimics {joint.mimics!r}; name a tip before it"
        )
    _check_axis(label, joint.axis)
    limit = joint.limit
    if limit is None:
        raise RobotError(f"{label}: expected limits, got none; add a <limit> element with {_wanted(joint)}")
    for what in ("velocity", "effort"):
        value = _number(label, what, limit)
        if not 0.0 < value < math.inf:
            raise RobotError(
                f"{label}: expected a positive {what} limit, got {limit[what]}; set {what} in its <limit> element"
            )
    if joint.kind in _LIMITED:
        lower, upper = _number(label, "lower", limit), _number(label, "upper", limit)
        if not -math.inf < lower < upper < math.inf:
            raise RobotError(
                f"{label}: expected finite limits lower < upper, got lower={limit['lower']} and "
                f"upper={limit['upper']}; correct its <limit> element"
            )


def _wanted(joint: UrdfJoint) -> str:
    return "lower, upper, velocity and effort" if joint.kind in _LIMITED else "velocity and effort"


def _number(label: str, what: str, limit: dict[str, str]) -> float:
    if what not in limit:
        raise RobotError(f"{label}: expected its {what} limit, got none; set {what} in its <limit> element")
    try:
        return float(limit[what])
    except ValueError as error:
        raise RobotError(f"{label}: expected a number for its {what} limit, got {limit[what]!r}") from error


def _check_origin(label: str, origin: dict[str, str] | None) -> None:
    """Refuse what pinocchio would take for zero: an attribute that it does not know."""
    for what, text in (origin or {}).items():
        if what not in ("xyz", "rpy"):
            raise RobotError(
                f"{label}: expected xyz and rpy in its <origin>, got {what!r}; correct the attribute's name"
            )
        numbers = _numbers_in(text)
        if len(numbers) != 3 or max(map(abs, numbers)) > _FARTHEST:
            raise RobotError(
                f"{label}: expected {what} of its <origin> as three finite numbers of at most {_FARTHEST:g}, "
                f"got {text!r}"
            )


def _check_axis(label: str, given: dict[str, str] | None) -> None:
    if given is None:
        return  # URDF's default, (1 0 0)
    if set(given) != {"xyz"}:
        got = ", ".join(map(repr, given)) or "none"
        raise RobotError(
            f"{label}: expected the attribute xyz and no other in its <axis> element, got {got}; "
            'write <axis xyz="0 0 1"/>, or leave the element out for URDF\'s default, x'
        )
    axis = _numbers_in(given["xyz"])
    if len(axis) != 3 or not any(axis):
        raise RobotError(f"{label}: expected an axis of three numbers that are not all zero, got {given['xyz']!r}")
    length = math.hypot(*axis)
    if not _AXIS_LENGTHS[0] <= length <= _AXIS_LENGTHS[1]:
        raise RobotError(
            f"{label}: expected an axis of length 1 (from {_AXIS_LENGTHS[0]:g} to {_AXIS_LENGTHS[1]:g} it is "
            f"normalised), got {given['xyz']!r} of length {length:.3g}"
        )


def _numbers_in(text: str) -> list[float]:
    """Finite numbers of an attribute; none where one of them is not."""
    try:
        numbers = [float(part) for part in text.split()]
    except ValueError:
        return []
    return numbers if all(map(math.isfinite, numbers)) else []
