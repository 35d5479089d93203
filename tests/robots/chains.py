"""Arms with any number of axes, written as URDF: for what must hold for an arm of any size."""

from __future__ import annotations

import functools
import tempfile
from pathlib import Path

import numpy as np

from kinqp.robots import Robot, load_robot


def chain_urdf(axes: int, *, seed: int = 0, share_prismatic: float = 0.3) -> str:
    """Write a serial arm, revolute and prismatic joints mixed, with masses, limits, and axes that are not aligned.

    Parameters
    ----------
    axes : int
        Number of joints.
    seed : int
        Of lengths, axes, limits and of which joints are prismatic.
    share_prismatic : float
        Share of joints that are prismatic [-].
    """
    rng = np.random.default_rng([seed, axes])
    parts = [f'<robot name="chain{axes}_{seed}"><link name="link0"/>']
    for i in range(1, axes + 1):
        prismatic = rng.random() < share_prismatic
        axis = rng.normal(size=3)
        # Every other axis along a frame's own: parallel and crossing axes are where arms are singular.
        axis = np.eye(3)[i % 3] if i % 2 else axis / np.linalg.norm(axis)
        origin, turn = rng.uniform(0.05, 0.3, 3) * [1.0, 0.3, 1.0], rng.uniform(-0.5, 0.5, 3) * (i % 2)
        low, high = (-0.2, 0.3) if prismatic else (-2.0, 2.5)
        parts.append(
            f'<joint name="joint{i}" type="{"prismatic" if prismatic else "revolute"}">'
            f'<parent link="link{i - 1}"/><child link="link{i}"/>'
            f'<origin xyz="{_text(origin)}" rpy="{_text(turn)}"/><axis xyz="{_text(axis)}"/>'
            f'<limit lower="{low}" upper="{high}" velocity="{rng.uniform(0.5, 2.0):.3f}" effort="100"/></joint>'
            f'<link name="link{i}"><inertial><origin xyz="0.01 0 0.05"/><mass value="{rng.uniform(0.5, 3.0):.3f}"/>'
            '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.012" iyz="0" izz="0.008"/></inertial></link>'
        )
    return "\n".join([*parts, "</robot>"])


def _text(vector: np.ndarray) -> str:
    return " ".join(f"{x:.6f}" for x in vector)


@functools.cache
def chain(axes: int, seed: int = 0) -> Robot:
    """Load the arm of `chain_urdf`."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "chain.urdf"
        path.write_text(chain_urdf(axes, seed=seed), encoding="utf-8")
        return load_robot(path)


@functools.cache
def scara() -> Robot:
    """Load a SCARA arm of four joints, its spindle the third: the tool's z is the spindle's axis, pointing down."""
    joints = (
        ("revolute", "0 0 0.4", "0 0 1", -2.9, 2.9, 2.0),
        ("revolute", "0.35 0 0", "0 0 1", -2.9, 2.9, 2.0),
        ("prismatic", "0.3 0 0", "0 0 -1", 0.0, 0.25, 1.0),
        ("revolute", "0 0 0", "0 0 1", -2.9, 2.9, 2.0),
    )
    parts = ['<robot name="scara"><link name="link0"/>']
    for i, (kind, origin, axis, low, high, velocity) in enumerate(joints, start=1):
        parts.append(
            f'<joint name="joint{i}" type="{kind}"><parent link="link{i - 1}"/><child link="link{i}"/>'
            f'<origin xyz="{origin}"/><axis xyz="{axis}"/>'
            f'<limit lower="{low}" upper="{high}" velocity="{velocity}" effort="100"/></joint>'
            f'<link name="link{i}"><inertial><mass value="1.5"/>'
            '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>'
        )
    parts.append(
        '<joint name="flange" type="fixed"><parent link="link4"/><child link="tool"/>'
        '<origin xyz="0 0 -0.1" rpy="3.141592653589793 0 0"/></joint><link name="tool"/></robot>'
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scara.urdf"
        path.write_text("\n".join(parts), encoding="utf-8")
        return load_robot(path)


@functools.cache
def one_joint(kind: str) -> Robot:
    """Load an arm of one revolute or prismatic joint, its tool 0.3 m off the joint's axis."""
    text = (
        '<robot name="one_joint"><link name="base"/><link name="tool"/><link name="link"><inertial>'
        '<origin xyz="0.1 0 0"/><mass value="1"/>'
        '<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>'
        f'<joint name="joint" type="{kind}"><parent link="base"/><child link="link"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="1" velocity="1" effort="10"/></joint>'
        '<joint name="flange" type="fixed"><parent link="link"/><child link="tool"/><origin xyz="0.3 0 0"/></joint>'
        "</robot>"
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "one_joint.urdf"
        path.write_text(text, encoding="utf-8")
        return load_robot(path)
