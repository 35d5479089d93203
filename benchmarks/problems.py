"""A block's recorded QPs: windows of consecutive ticks of the reference's run, the same for all its cells."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from ..solvers import QP

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

_PARTS: Final = ("H", "g", "stacked", "lower", "upper")


@dataclass(frozen=True)
class Window:
    """Consecutive ticks of a run.

    Attributes
    ----------
    lead : int
        The tick solved first, with a full set-up.
    ticks : tuple of int
        Those that follow.
    """

    lead: int
    ticks: tuple[int, ...]


@dataclass(frozen=True)
class Problems:
    """QPs of a run.

    Attributes
    ----------
    windows : tuple of Window
        In the order in which they are to be taken: who can't afford all takes the first ones.
    qps : dict of int to tuple of QP
        Of each tick, in the order in which they are solved: one, or those of a hierarchy's levels.
    """

    windows: tuple[Window, ...]
    qps: dict[int, tuple[QP, ...]]

    def to_bytes(self) -> bytes:
        """Write them as a NumPy archive."""
        flat = [(tick, qp) for tick, levels in self.qps.items() for qp in levels]
        arrays: dict[str, NDArray[np.float64] | NDArray[np.int64]] = {
            "leads": np.array([window.lead for window in self.windows], dtype=np.int64),
            "lengths": np.array([len(window.ticks) for window in self.windows], dtype=np.int64),
            "ticks": np.array([tick for window in self.windows for tick in window.ticks], dtype=np.int64),
            "tick": np.array([tick for tick, _ in flat], dtype=np.int64),
            "sizes": np.array([(qp.n, qp.m_eq, qp.m_ineq, qp.x_feasible is not None) for _, qp in flat], np.int64),
            "start": np.concatenate([qp.x_feasible for _, qp in flat if qp.x_feasible is not None] or [np.zeros(0)]),
        }
        for part in _PARTS:
            arrays[part] = np.concatenate([getattr(qp, part).ravel() for _, qp in flat])
        buffer = io.BytesIO()
        # Not by keyword arguments of its own, which its stubs take them for.
        _save(buffer, arrays)
        return buffer.getvalue()

    @classmethod
    def from_bytes(cls, content: bytes) -> Problems:
        """Read what `to_bytes` wrote."""
        with np.load(io.BytesIO(content)) as archive:
            read = {name: archive[name] for name in archive.files}
        splits = np.split(read["ticks"], np.cumsum(read["lengths"])[:-1])
        windows = [
            Window(int(lead), tuple(int(tick) for tick in ticks))
            for lead, ticks in zip(read["leads"], splits, strict=True)
        ]
        place = dict.fromkeys((*_PARTS, "start"), 0)
        qps: dict[int, tuple[QP, ...]] = {}
        for tick, (n, m_eq, m_ineq, started) in zip(read["tick"].tolist(), read["sizes"].tolist(), strict=True):
            rows = m_eq + m_ineq
            shapes = {"H": (n, n), "g": (n,), "stacked": (rows + n, n), "lower": (rows + n,), "upper": (rows + n,)}
            if started:
                shapes["start"] = (n,)
            part = {}
            for name, shape in shapes.items():
                size = int(np.prod(shape))
                part[name] = read[name][place[name] : place[name] + size].reshape(shape)
                place[name] += size
            qp = QP.trusted(
                H=part["H"], g=part["g"], A=part["stacked"][:m_eq], b=part["lower"][:m_eq],
                C=part["stacked"][m_eq:rows], l=part["lower"][m_eq:rows], u=part["upper"][m_eq:rows],
                lb=part["lower"][rows:], ub=part["upper"][rows:], x_feasible=part.get("start"),
            )  # fmt: skip
            qps[tick] = (*qps.get(tick, ()), qp)
        return cls(tuple(windows), qps)


def _save(buffer: io.BytesIO, arrays: Mapping[str, NDArray[np.float64] | NDArray[np.int64]]) -> None:
    np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]  # the stubs take any keyword for `allow_pickle`


def choose_windows(ticks: int, wanted: int, length: int, seed: int) -> tuple[Window, ...]:
    """Spread windows over a run.

    Parameters
    ----------
    ticks : int
        Length of the run.
    wanted : int
        Ticks in all windows together, their leads aside.
    length : int
        Ticks of a window.
    seed : int
        Of their order.
    """
    if ticks == 1:
        return (Window(0, (0,)),)
    length = min(length, ticks - 1, wanted)
    count = min(max(wanted // length, 1), (ticks - 1) // length)
    # As far apart as they can be, and none of them overlapping.
    leads = np.floor(np.linspace(0, ticks - 1 - length, count)).astype(int) if count > 1 else np.array([0])
    windows = [Window(int(lead), tuple(range(int(lead) + 1, int(lead) + 1 + length))) for lead in leads]
    order = np.random.default_rng(seed).permutation(count)
    return tuple(windows[index] for index in order)


def ticks_of(windows: Sequence[Window]) -> tuple[int, ...]:
    """All ticks of windows, leads included, each once, in the order of the run."""
    return tuple(sorted({tick for window in windows for tick in (window.lead, *window.ticks)}))
