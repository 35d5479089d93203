"""
Arms: limits, and numeric and symbolic kinematics, from URDF files or DH tables.

Use `load_robot`; everything else is for those who add a robot or build on one.
"""

from .capsules import Capsule, CapsuleModel, capsule_model
from .checks import FloatArray, finite_vector, real_array
from .dh import DhRow, robot_from_dh
from .errors import RobotError
from .limits import DEFAULT_PRISMATIC_QDD_MAX, DEFAULT_REVOLUTE_QDD_MAX
from .registry import RobotBuilder, available_robots, load_robot
from .robot import Robot
from .symbolic import SymbolicKinematics
from .tool import with_tool
from .urdf import robot_from_urdf
from .workspace import Workspace, sample_workspace, tool_positions

__all__ = [
    "DEFAULT_PRISMATIC_QDD_MAX",
    "DEFAULT_REVOLUTE_QDD_MAX",
    "Capsule",
    "CapsuleModel",
    "DhRow",
    "FloatArray",
    "Robot",
    "RobotBuilder",
    "RobotError",
    "SymbolicKinematics",
    "Workspace",
    "available_robots",
    "capsule_model",
    "finite_vector",
    "load_robot",
    "real_array",
    "robot_from_dh",
    "robot_from_urdf",
    "sample_workspace",
    "tool_positions",
    "with_tool",
]
