"""Physiological tremor: seeded noise between 8 and 12 Hz."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: The band of physiological tremor [Hz].
BAND: Final = (8.0, 12.0)
_LINES: Final = 16


class Tremor:
    r"""Noise in a band, of unit RMS on each of several axes, as a function of time.

    A sum of sines whose frequencies are drawn one from each of 16 equal parts of the band, and whose phases are drawn
    from the whole circle:

    .. math:: n_j(t) = \sqrt{2 / L} \sum_{i=1}^{L} \sin(2 \pi f_{ij} t + \varphi_{ij})

    So no power lies outside the band, however long one listens, it does not depend on the control period, and the same
    seed gives the same noise. Frequencies are incommensurate: it does not repeat within a run.

    Physiological tremor has its peak between 8 and 12 Hz (T. Novak, K. M. Newell, Neuroscience Letters, 2017, on
    isometric force), almost independently of the force exerted (G. G. Sutton, K. Sykes, J. Physiology 191 (1967)).

    Parameters
    ----------
    seed : int or sequence of int
        Chooses frequencies and phases.
    axes : int
        How many independent components.
    band : tuple of float
        Lowest and highest frequency [Hz].

    Raises
    ------
    ValueError
        When the band is not one.
    """

    def __init__(self, seed: int | Sequence[int], axes: int = 6, band: tuple[float, float] = BAND) -> None:
        low, high = band
        if not 0.0 < low < high < np.inf:
            raise ValueError(f"band: expected 0 < lowest < highest frequency [Hz], got {band}")
        rng = np.random.default_rng(seed)
        parts = np.arange(_LINES) + rng.random((axes, _LINES))
        self._omega: Final[Array] = 2.0 * np.pi * (low + (high - low) * parts / _LINES)
        self._amplitude: Final[Array] = np.full(_LINES, np.sqrt(2.0 / _LINES))
        self._phase: Final[Array] = 2.0 * np.pi * rng.random((axes, _LINES))

    def __call__(self, t: float) -> Array:
        """Give the noise at time `t` [s], shape (axes,), of unit RMS."""
        noise: Array = np.sin(self._omega * t + self._phase) @ self._amplitude
        return noise
