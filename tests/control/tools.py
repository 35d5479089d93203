"""Tools to put a hand on, without a robot: a mass in oil that is free, frozen, or stopped by a wall."""

from collections.abc import Callable

import numpy as np

DT = 1e-3
DAMPING = 60.0

Rule = Callable[[np.ndarray, np.ndarray], np.ndarray]


def free(_position, velocity):
    return velocity


def frozen(_position, velocity):
    return np.zeros_like(velocity)


def sliding(height: float) -> Rule:
    """A ceiling along which the tool slides: what an algorithm should make of a limit."""

    def rule(position, velocity):
        highest = max(height - position[2], 0.0) / DT
        return np.array([velocity[0], velocity[1], min(velocity[2], highest)])

    return rule


def freezing(height: float) -> Rule:
    """A ceiling at which all motion ends that would go on through it: algorithm B."""

    def rule(position, velocity):
        return np.zeros(3) if position[2] + DT * velocity[2] > height else velocity

    return rule


def guide(operator, start, rule: Rule, duration: float, *, dt: float = DT):
    """Let a hand guide a tool whose velocity is force over damping, as far as the rule lets it; dict of arrays."""
    operator.reset()
    position, velocity = np.array(start, dtype=float), np.zeros(3)
    rows = []
    for tick in range(round(duration / dt)):
        pose = np.eye(4)
        pose[:3, 3] = position
        wrench = operator.wrench(tick * dt, pose, np.concatenate([velocity, np.zeros(3)]))
        velocity = rule(position, wrench[:3] / DAMPING)
        rows.append((tick * dt, position, velocity, wrench, operator.aim, operator.progress, operator.doing))
        position = position + dt * velocity
        if operator.finished((tick + 1) * dt):
            break
    names = ("t", "position", "velocity", "wrench", "aim", "progress", "doing")
    return dict(zip(names, (np.array(column) for column in zip(*rows, strict=True)), strict=True))
