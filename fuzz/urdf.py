"""libFuzzer, by way of atheris, on what `load_robot` reads: any bytes give a robot or a RobotError.

Bytes that begin with "<" are a file as they are; others are choices, of which a file is made that is nearly a URDF.
"""

from __future__ import annotations

import contextlib
import sys
import tempfile
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["kinqp.robots", "xml.etree"]):
    from kinqp.robots import RobotError, load_robot

import casadi as ca
import numpy as np

NUMBERS = (
    *("0", "1", "-1", "0.5", "3.14", "1e-9", "1e-300", "5e-324", "1e9", "1e154", "1e200", "1e308", "-1e308", "1e999"),
    *("inf", "-inf", "nan", "", " ", "a", "0x10", "1,5", "1_0", "\u0661", "${pi}", "1 2"),
)
KINDS = ("revolute", "prismatic", "continuous", "fixed", "floating", "planar", "spherical", "", "Revolute")
NAMES = ("a", "b", "c", "universe", "root_joint", "", "*/ int x; /*", "a b", "&amp;", "\u202e", "world")
EXTRA = (
    "",
    "<mimic joint='j0'/>",
    "<axis/>",
    "<limit/>",
    "<parent link='l0'/>",
    "<child link='l1'/>",
    "<origin/>",
    "<a><b/></a>",
)


def nearly_a_urdf(data: atheris.FuzzedDataProvider) -> str:
    """Write a chain in which anything may be wrong, but most of the time little is."""
    rate = data.ConsumeIntInRange(0, 40)

    def odd() -> bool:
        return data.ConsumeIntInRange(0, 40) < rate // 4

    def pick(usual: str, others: tuple[str, ...]) -> str:
        return others[data.ConsumeIntInRange(0, len(others) - 1)] if odd() else usual

    def three(usual: str) -> str:
        return " ".join(pick(part, NUMBERS) for part in usual.split())

    count = data.ConsumeIntInRange(0, 8)
    links = [pick(f"l{i}", NAMES) for i in range(count + 1)]
    parts = [f'<robot name="{pick("arm", NAMES)}">']
    for name in links:
        mass, ixx = pick("1", NUMBERS), pick("0.01", NUMBERS)
        inertia = f'<inertia ixx="{ixx}" iyy="0.01" izz="0.01" ixy="{pick("0", NUMBERS)}" ixz="0" iyz="0"/>'
        inertial = f'<inertial><origin xyz="{three("0 0 0.1")}"/><mass value="{mass}"/>{inertia}</inertial>'
        parts.append(f'<link name="{name}">{"" if odd() else inertial}</link>')
    for i in range(count):
        kind = pick(KINDS[data.ConsumeIntInRange(0, 3)], KINDS)
        limit = (
            f'<limit lower="{pick("-1", NUMBERS)}" upper="{pick("1", NUMBERS)}" '
            f'velocity="{pick("1", NUMBERS)}" effort="{pick("1", NUMBERS)}"/>'
        )
        parent = links[data.ConsumeIntInRange(0, count)] if odd() else links[i]
        axis = ("1 0 0", "0 1 0", "0 0 1", "1 1 1", "0 -1 0")[data.ConsumeIntInRange(0, 4)]
        name = pick(f"j{i}", NAMES)
        parts.append(
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{links[i + 1]}"/>'
            f'<origin xyz="{three("0 0 0.3")}" rpy="{three("0 0 0")}"/><axis xyz="{three(axis)}"/>'
            f"{'' if odd() else limit}{pick('', EXTRA)}</joint>"
        )
    return "".join(parts) + "</robot>"


def load(file: Path, content: bytes) -> None:
    """Load a robot and move it once, in numbers and in symbols."""
    file.write_bytes(content)
    with contextlib.suppress(RobotError):
        robot = load_robot(file)
        q = np.clip(np.zeros(robot.nv), robot.q_min, robot.q_max)
        symbol = ca.SX.sym("q", robot.nv)
        pose = ca.Function("pose", [symbol], [robot.symbolic(symbol).pose])(q).full()
        size = 1.0 + np.abs(robot.pose(q)[:3, 3]).max()
        if not np.abs(pose - robot.pose(q)).max() <= 1e-9 * size:
            raise AssertionError(f"numbers and symbols disagree: {pose}, {robot.pose(q)}")


def main() -> None:
    """Run libFuzzer with the arguments given."""
    with tempfile.TemporaryDirectory() as scratch:
        file = Path(scratch) / "robot.urdf"

        def once(data: bytes) -> None:
            made = nearly_a_urdf(atheris.FuzzedDataProvider(data)).encode("utf-8", "replace")
            load(file, data if data[:1] == b"<" else made)

        atheris.Setup(sys.argv, once)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
