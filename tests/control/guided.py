"""The arm, the posture and the controllers that tests of hand guiding share."""

from __future__ import annotations

import numpy as np
from hypothesis import settings

from kinqp.control import GuidingController, make_guiding
from kinqp.robots import load_robot

ROBOT = load_robot("lbr_med14")
START = np.deg2rad([-55.0, 65.0, 10.0, -90.0, -5.0, 30.0, 0.0])
DT = 1e-3
# A machine that is busy with other things must not fail a property.
quick = settings(deadline=None, max_examples=30, derandomize=True)


def guiding(modes=("fix-orientation",), formulation="joint-space", **options):
    """A controller of the LBR."""
    return make_guiding(ROBOT, formulation, list(modes), **options)


_CONTROLLERS: dict[str, GuidingController] = {}


def controller_with(settings):
    """The controller that all examples of a property share, as making one lowers a formulation: at rest, so set."""
    if "one" not in _CONTROLLERS:
        _CONTROLLERS["one"] = guiding()
    controller = _CONTROLLERS["one"]
    controller.reset()
    controller.set(
        admittance_damping=settings.admittance_damping,
        force_dead_zone=settings.force_dead_zone,
    )
    return controller
