"""Constraints to put on any formulation: rows on its command, each with the rule by which it stays feasible."""

from .base import Constrained, Constraint
from .contact_force import ContactForce
from .elbow import ElbowBend, ElbowHold, ElbowRange
from .gaps import APPROACHES, GapConstraint, Gaps
from .obstacles import Obstacle, Obstacles
from .registry import available_constraints, get_constraint
from .remote_centre import RemoteCentre
from .self_collision import SelfCollision
from .singularity import SingularityAvoidance
from .twist_limits import TwistLimits

__all__ = [
    "APPROACHES",
    "Constrained",
    "Constraint",
    "ContactForce",
    "ElbowBend",
    "ElbowHold",
    "ElbowRange",
    "GapConstraint",
    "Gaps",
    "Obstacle",
    "Obstacles",
    "RemoteCentre",
    "SelfCollision",
    "SingularityAvoidance",
    "TwistLimits",
    "available_constraints",
    "get_constraint",
]
