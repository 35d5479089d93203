"""Families of solvers, ``family:member``: one bridge to as many as the bridged library finds installed."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from typing import TYPE_CHECKING

from .options import hint
from .plugins import PluginError

if TYPE_CHECKING:
    from collections.abc import Callable

    from .solver import Solver


@dataclass(frozen=True, slots=True)
class Family:
    """A bridge to the solvers behind another library.

    Parameters
    ----------
    name
        What stands before the colon.
    requires
        Top-level module of the bridged library.
    members
        Lists what stands behind the colon: the names, in the bridged library's spelling, of the solvers that it finds
        installed. Imports the library.
    bridge
        Makes the class for one of them.
    """

    name: str
    requires: str
    members: Callable[[], tuple[str, ...]]
    bridge: Callable[[str], type[Solver]]

    def names(self) -> tuple[str, ...]:
        """Full names of the members, none if the bridged library is not installed; imports it if it is."""
        if find_spec(self.requires) is None:
            return ()
        return tuple(f"{self.name}:{member}" for member in sorted(self.members()))

    def find(self, member: str) -> type[Solver]:
        """Return the class of a member.

        Raises
        ------
        PluginError
            When the bridged library is not installed, or finds no such solver installed.
        """
        if find_spec(self.requires) is None:
            raise PluginError(
                f"solver '{self.name}:{member}' needs {self.requires}, which is not installed: install it."
            )
        members = sorted(self.members())
        if member not in members:
            raise PluginError(
                f"solver '{self.name}:{member}': {self.requires} finds no solver {member!r} installed"
                f"{hint(member, members)}; the choices are {', '.join(members) or 'none'}."
            )
        return self.bridge(member)
