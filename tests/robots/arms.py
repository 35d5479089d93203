"""The arms that the tests run on: registered ones, four of example-robot-data, one with every joint kind."""

from __future__ import annotations

import functools
import importlib.metadata
from pathlib import Path

from kinqp.robots import Robot, available_robots, load_robot

_EXAMPLES = {
    "panda": ("panda_description/urdf/panda.urdf", "panda_hand"),
    "ur5": ("ur_description/urdf/ur5_robot.urdf", "tool0"),
    "so101": ("so_arm_description/urdf/so101.urdf", "gripper_frame_link"),
    "kinova": ("kinova_description/robots/kinova.urdf", "j2s6s200_end_effector"),
}

_MIXED_TIPS = {"mixed_to_tool": "tool", "mixed_to_side": "side"}

ARMS = ("lbr_med14", "lbr_med7", "ur5e", "davinci5", *_EXAMPLES, *_MIXED_TIPS)


def example_urdf(name: str) -> Path:
    """Return where the example-robot-data wheel put an arm's URDF."""
    suffix = f"robots/{_EXAMPLES[name][0]}"
    found = [
        Path(str(file.locate()))
        for file in importlib.metadata.files("example-robot-data") or ()
        if str(file).endswith(suffix)
    ]
    return found[0]


@functools.cache
def arm(name: str) -> Robot:
    """Return an arm of `ARMS`."""
    if name in available_robots():
        return load_robot(name)
    if name in _EXAMPLES:
        return load_robot(example_urdf(name), tip=_EXAMPLES[name][1])
    return load_robot(Path(__file__).parent / "mixed.urdf", tip=_MIXED_TIPS[name])
