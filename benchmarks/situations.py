"""States of a baseline's run, recorded to be resolved again: windows of consecutive ticks, as QPs are recorded."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .loop import State
from .problems import Window

if TYPE_CHECKING:
    from .scenarios import Scenario


@dataclass(frozen=True)
class Situations:
    """States of a run.

    Attributes
    ----------
    windows : tuple of Window
        In the order in which they are to be taken.
    states : dict of int to State
        Of each tick of the windows.
    """

    windows: tuple[Window, ...]
    states: dict[int, State]

    def to_bytes(self) -> bytes:
        """Write them as a NumPy archive."""
        states = list(self.states.values())
        buffer = io.BytesIO()
        np.savez_compressed(
            buffer,
            leads=np.array([window.lead for window in self.windows], dtype=np.int64),
            lengths=np.array([len(window.ticks) for window in self.windows], dtype=np.int64),
            ticks=np.array([tick for window in self.windows for tick in window.ticks], dtype=np.int64),
            tick=np.array([state.tick for state in states], dtype=np.int64),
            phase=np.array([state.phase for state in states], dtype=np.int64),
            q=np.array([state.q for state in states]),
            qd_prev=np.array([state.qd_prev for state in states]),
            v=np.concatenate([state.v for state in states]),
            m_free=np.array([len(state.v) for state in states], dtype=np.int64),
        )
        return buffer.getvalue()

    @classmethod
    def from_bytes(cls, content: bytes, scenario: Scenario) -> Situations:
        """Read what `to_bytes` wrote, of the scenario that was run."""
        with np.load(io.BytesIO(content)) as archive:
            read = {name: archive[name] for name in archive.files}
        splits = np.split(read["ticks"], np.cumsum(read["lengths"])[:-1])
        windows = tuple(
            Window(int(lead), tuple(int(tick) for tick in ticks))
            for lead, ticks in zip(read["leads"], splits, strict=True)
        )
        v = np.split(read["v"], np.cumsum(read["m_free"])[:-1])
        states = {}
        for index, (tick, phase) in enumerate(zip(read["tick"].tolist(), read["phase"].tolist(), strict=True)):
            mode = scenario.states.mode if scenario.states is not None else scenario.phases[phase].mode
            states[tick] = State(tick, phase, mode, read["q"][index], read["qd_prev"][index], v[index])
        return cls(windows, states)
