"""Finding a plug-in: by registered name, by entry point, or by `module:Name`; with options behind the name."""

from __future__ import annotations

import inspect
import re
from dataclasses import dataclass, field
from importlib import import_module
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Generic, TypeVar

from .options import UnknownOptionError, unknown

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

T = TypeVar("T")

_SPEC = re.compile(r"\s*(?P<name>[^()\s]+)\s*(?:\((?P<options>[^()]*)\))?\s*")


class PluginError(ValueError):
    """A plug-in cannot be found, loaded or constructed; the message names it and the choices."""


@dataclass(frozen=True)
class Registry(Generic[T]):
    """Plug-ins of one kind.

    Parameters
    ----------
    kind
        What they are, for messages: "solver".
    group
        Entry-point group in which installed packages offer more of them, as ``name = "module:Name"``.
    base
        What they make.
    builtin
        The library's own, by name: a subclass of `base`, or a function that returns one.
    families
        What finds the same behind ``family:member``, by the name before the colon; such a family hides a module of
        its name from ``module:Name``.
    """

    kind: str
    group: str
    base: type[T]
    builtin: dict[str, object]
    families: Mapping[str, Callable[[str], object]] = field(default_factory=dict)

    def names(self) -> tuple[str, ...]:
        """Names of the built-in ones and of those that installed packages offer, sorted."""
        return tuple(sorted({*self.builtin, *(entry.name for entry in entry_points(group=self.group))}))

    def find(self, name: str) -> object:
        """Return the class or function behind a registered name, ``family:member`` or ``module:Name``.

        Raises
        ------
        PluginError
            When there is none of that name, or it cannot be loaded.
        """
        if name in self.builtin:
            return self.builtin[name]
        try:
            if ":" in name:
                module, _, attribute = name.partition(":")
                if module in self.families:
                    return self.families[module](attribute)
                return getattr(import_module(module), attribute)
            for entry in entry_points(group=self.group):
                if entry.name == name:
                    return entry.load()
        except PluginError:
            raise
        except (ImportError, AttributeError, ValueError) as error:
            raise PluginError(f"{self.kind} {name!r}: it cannot be loaded: {error}") from error
        raise PluginError(unknown(self.kind, name, self.names()))

    def make(self, spec: str, /, **options: object) -> T:
        """Construct a plug-in from its name, options in brackets behind it: ``"clarabel(tolerance=1e-8)"``.

        Raises
        ------
        PluginError
            When it cannot be found, or makes something else than it should.
        UnknownOptionError
            When it has no option of that name.
        """
        name, given = parse_spec(self.kind, spec)
        maker = self.find(name)
        if not callable(maker):
            raise PluginError(f"{self.kind} {name!r}: expected a class or a function, got {maker!r}")
        choices = list(inspect.signature(maker).parameters)
        for option in (options := given | options):
            if option not in choices:
                raise UnknownOptionError(unknown(f"option of {self.kind} {name!r}", option, choices))
        made = maker(**options)
        if not isinstance(made, self.base):
            raise PluginError(f"{self.kind} {name!r}: expected a {self.base.__name__}, got {made!r}")
        return made

    def get(self, given: str | T, /, **options: object) -> T:
        """Make a plug-in from its name, see `make`; an instance is returned as it is.

        Raises
        ------
        PluginError
            As in `make`, or when options come with an instance.
        UnknownOptionError
            As in `make`.
        """
        if isinstance(given, str):
            return self.make(given, **options)
        if options:
            raise PluginError(f"{self.kind}: expected no options with an instance, got {', '.join(options)}")
        return given


def parse_spec(kind: str, spec: str) -> tuple[str, dict[str, object]]:
    """Split ``name(key=value, ...)`` into the name and the options; numbers become numbers, all else stays text."""
    match = _SPEC.fullmatch(spec)
    if match is None:
        raise PluginError(f"{kind}: expected name or name(option=value, ...), got {spec!r}")
    options: dict[str, object] = {}
    for part in filter(None, (part.strip() for part in (match["options"] or "").split(","))):
        key, equals, value = part.partition("=")
        if not (equals and key.strip() and value.strip()):
            raise PluginError(f"{kind} {match['name']!r}: expected option=value, got {part!r}")
        options[key.strip()] = _number_or_text(value.strip())
    return match["name"], options


def _number_or_text(text: str) -> object:
    for convert in (int, float):
        try:
            return convert(text)
        except ValueError:
            continue
    return text
