"""
The set of points that a tool can reach, by sampling.

Joint positions are drawn evenly over the joint ranges (a scrambled Sobol sequence), but their tool points crowd
where the arm is slow. So space is divided into cubes, of which each that was hit counts once: points are as even
as the cubes, and the boundary is that of the cubes that were hit.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from .checks import real_array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from .checks import FloatArray
    from .robot import Robot


def tool_positions(robot: Robot, Q: ArrayLike) -> FloatArray:
    """
    Return the tool centre points of many joint positions at once.

    Parameters
    ----------
    robot
        Any.
    Q
        Shape (N, nv): joint positions [rad or m].

    Returns
    -------
    Shape (N, 3), base frame [m].

    Raises
    ------
    ValueError
        If `Q` has the wrong shape or is not finite.
    """
    states = real_array("Q", Q)
    if states.ndim != 2 or states.shape[1] != robot.nv or not np.isfinite(states).all():
        raise ValueError(f"Q: expected finite joint positions of shape (N, {robot.nv}), got shape {states.shape}")
    q = ca.SX.sym("q", robot.nv)
    position = ca.Function("position", [q], [robot.symbolic(q).pose[:3, 3]])
    # A function given more columns than it takes is mapped over them.
    return np.asarray(position(states.T).full().T if len(states) else np.empty((0, 3)), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Workspace:
    """
    A reachable set, as cubes.

    Parameters
    ----------
    corner
        Shape (3,): lowest corner of the grid of cubes, base frame [m].
    spacing
        Edge of a cube [m].
    hit
        Shape (X, Y, Z): which cubes hold a tool point; the outermost layer is never hit.
    points
        Shape (N, 3): one tool point in every cube that was hit, the first one drawn [m].
    q
        Shape (N, nv): their joint positions [rad or m].
    samples
        Number of joint positions drawn.
    """

    corner: FloatArray
    spacing: float
    hit: NDArray[np.bool_]
    points: FloatArray
    q: FloatArray
    samples: int

    @property
    def volume(self) -> float:
        """Volume of the cubes that were hit [m^3]: too large by about half a cube along the boundary."""
        return float(np.count_nonzero(self.hit)) * self.spacing**3

    @cached_property
    def filled(self) -> NDArray[np.bool_]:
        """`hit`, with gaps of one cube closed: those that the samples happened to miss."""
        from scipy import ndimage  # here, because it takes a quarter of a second to import

        closed = ndimage.binary_closing(self.hit, ndimage.generate_binary_structure(3, 1))
        return np.asarray(closed | self.hit, dtype=np.bool_)

    @property
    def on_boundary(self) -> NDArray[np.bool_]:
        """Shape (N,): which of `points` lie in a cube with a neighbour, face to face, out of reach."""
        from scipy import ndimage

        inner = ndimage.binary_erosion(self.filled, ndimage.generate_binary_structure(3, 1))
        surface: NDArray[np.bool_] = ~inner[tuple(self._cubes(self.points).T)]
        return surface

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """
        Return whether points lie in cubes that were hit.

        Parameters
        ----------
        points
            Shape (N, 3), base frame [m].
        """
        cubes = self._cubes(np.asarray(points, dtype=np.float64))
        inside = ((cubes >= 0) & (cubes < self.hit.shape)).all(axis=1)
        result = np.zeros(len(cubes), dtype=np.bool_)
        result[inside] = self.filled[tuple(cubes[inside].T)]
        return result

    def boundary(self) -> tuple[FloatArray, NDArray[np.int64]]:
        """
        Return the surface of the reachable set as triangles.

        Returns
        -------
        Corners, shape (V, 3) [m], and triangles, shape (F, 3): indices of corners, counter-clockwise from outside.
        """
        cubes = np.pad(self.filled, 1)
        squares = []
        for axis in range(3):
            first, second = (axis + 1) % 3, (axis + 2) % 3
            for step, order in ((1, ((0, 0), (1, 0), (1, 1), (0, 1))), (-1, ((0, 0), (0, 1), (1, 1), (1, 0)))):
                faces = np.argwhere(cubes & ~np.roll(cubes, -step, axis))
                faces[:, axis] += step > 0
                square = np.repeat(faces[:, None, :], 4, axis=1)
                for corner, (along_first, along_second) in enumerate(order):
                    square[:, corner, first] += along_first
                    square[:, corner, second] += along_second
                squares.append(square)
        every = np.concatenate(squares)
        corners, index = np.unique(every.reshape(-1, 3), axis=0, return_inverse=True)
        quads = index.reshape(-1, 4)
        triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
        return self.corner + self.spacing * (corners - 1), triangles.astype(np.int64)

    def outline(self, axis: int) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
        """
        Return the shadow of the reachable set along an axis.

        Parameters
        ----------
        axis
            0, 1 or 2: x, y or z, which is looked along.

        Returns
        -------
        Centres of the cells along the two other axes in order [m], and shape (A, B): which cells are covered.
        """
        if axis not in (0, 1, 2):
            raise ValueError(f"axis: expected 0, 1 or 2, got {axis}")
        kept = [i for i in range(3) if i != axis]
        first, second = (self.corner[i] + self.spacing * (np.arange(self.hit.shape[i]) + 0.5) for i in kept)
        covered: NDArray[np.bool_] = np.logical_or.reduce(self.filled, axis=axis)
        return first, second, covered

    def _cubes(self, points: FloatArray) -> NDArray[np.int64]:
        cubes: NDArray[np.int64] = np.floor((points - self.corner) / self.spacing).astype(np.int64)
        return cubes


def sample_workspace(robot: Robot, samples: int = 1_000_000, *, spacing: float, seed: int = 0) -> Workspace:
    """
    Sample the reachable set within the position limits.

    Parameters
    ----------
    robot
        Any; joints without limits turn once.
    samples
        Number of joint positions to draw, rounded up to a power of two, which a Sobol sequence wants.
    spacing
        Edge of the cubes [m]. Cubes near the boundary are the last to be hit: halving it wants at least eight
        times the samples.
    seed
        Of the sequence's scrambling: same input, same result.

    Returns
    -------
    The reachable set.

    Raises
    ------
    ValueError
        If an option is out of range.
    """
    from scipy.stats import qmc  # here, because it takes half a second to import

    if not 0.0 < spacing < np.inf:
        raise ValueError(f"spacing: expected a positive length, got {spacing}")
    if samples < 1:
        raise ValueError(f"samples: expected at least 1, got {samples}")
    low = np.where(np.isfinite(robot.q_min), robot.q_min, -np.pi)
    high = np.where(np.isfinite(robot.q_max), robot.q_max, np.pi)
    sequence = qmc.Sobol(robot.nv, rng=np.random.default_rng(seed))
    Q = low + sequence.random_base2(int(np.ceil(np.log2(samples)))) * (high - low)
    points = tool_positions(robot, Q)
    corner = points.min(axis=0) - 1.5 * spacing
    cubes = np.floor((points - corner) / spacing).astype(np.int64)
    shape = cubes.max(axis=0) + 2
    _, first = np.unique(np.ravel_multi_index(tuple(cubes.T), tuple(shape)), return_index=True)
    hit = np.zeros(shape, dtype=np.bool_)
    hit[tuple(cubes[first].T)] = True
    return Workspace(corner=corner, spacing=spacing, hit=hit, points=points[first], q=Q[first], samples=len(Q))
