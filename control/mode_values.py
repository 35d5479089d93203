"""What a compiled hand-guiding controller is set to in each of its modes; its C has one struct for all of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from ..formulations import InputError
from ..formulations.inputs import describe_input
from .set_inputs import check_order, checked_values

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from ..formulations import Input, Mode

    Array = NDArray[np.float64]


class ModeValues:
    """The values of each mode, and the struct that holds those of the mode in force.

    Parameters
    ----------
    modes : sequence of Mode
    specs : sequence of mapping of str to Input
        What can be set in each of them.
    places : mapping of str to ndarray
        Views of the struct, by name; as wide as the widest mode needs.
    """

    def __init__(
        self, modes: Sequence[Mode], specs: Sequence[Mapping[str, Input]], places: Mapping[str, Array]
    ) -> None:
        self._modes: Final = modes
        self._specs: Final = specs
        self._places: Final = places
        self._values: Final = [
            {name: spec.default for name, spec in known.items() if spec.default is not None} for known in specs
        ]
        # What has no default is looked at here; a mode that does not have it must not be refused for it.
        for name, place in places.items():
            given = [known[name] for known in specs if name in known and known[name].default is None]
            if given:
                place[:] = np.clip(0.0, *given[0].range)
        self._written: int | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """What can be set, in one mode or another."""
        return tuple(dict.fromkeys(name for known in self._specs for name in known))

    def set(self, mode: str | Mode | None, inputs: Mapping[str, ArrayLike]) -> None:
        """Change values; all of them, or none if one is not accepted.

        Raises
        ------
        InputError, ValueError
            As `checked_values` and `check_order`.
        """
        checked = checked_values(self._modes, self._specs, mode, inputs)
        for index, values in checked.items():
            check_order(values, self._values[index])
        for index, values in checked.items():
            self._values[index].update(values)
        self._written = None

    def write(self, mode: int) -> None:
        """Put the values of a mode into the struct.

        Raises
        ------
        InputError
            Naming a value without a default that was not set.
        """
        # A mode that is none of them is refused by the tick.
        if mode == self._written or not 0 <= mode < len(self._modes):
            return
        self.put(mode)
        for name, spec in self._specs[mode].items():
            if name not in self._values[mode]:
                raise InputError(f"{name}: expected {describe_input(spec, self._modes[mode])}, got nothing")

    def put(self, mode: int) -> None:
        """Put what there is of the values of a mode into the struct."""
        for name, values in self._values[mode].items():
            self._places[name][: len(values)] = values
        self._written = mode if self._values[mode].keys() >= self._specs[mode].keys() else None
