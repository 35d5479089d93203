"""A sweep's configuration from TOML; every mistake in it is one sentence that says where."""

from __future__ import annotations

import re
import tomllib
from importlib.resources import files
from typing import TYPE_CHECKING

from pydantic import ValidationError

from .. import configs
from .cells import STARTS
from .config import ALL, CHOICES, Product, SweepConfig, starts_of

if TYPE_CHECKING:
    from pathlib import Path

    from pydantic_core import ErrorDetails


class ConfigError(ValueError):
    """A sweep's configuration can't be used; the message names line and key, what was expected and what was got."""


def load_config(path: Path | None = None) -> SweepConfig:
    """Read a sweep from a TOML file; without one, the shipped default.

    Where there is no such file, ``configs/full.toml`` and the like are those that came with the library.

    Raises
    ------
    ConfigError
        Naming the file, the line, the key, and the choices.
    """
    if path is None:
        return SweepConfig()
    try:
        text = _shipped(path) or path.read_text(encoding="utf-8")
        given = tomllib.loads(text)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise ConfigError(f"{path}: expected a readable TOML file: {error}") from error
    return make_config(given, str(path), text)


def _shipped(path: Path) -> str | None:
    shipped = files(configs).joinpath(path.name)
    if path.exists() or path.parent.name != "configs" or not shipped.is_file():
        return None
    return shipped.read_text(encoding="utf-8")


def make_config(given: dict[str, object], source: str = "sweep", text: str = "") -> SweepConfig:
    """Check a sweep given as a mapping; errors name `source`, the line of its `text`, the key and the choices."""
    try:
        config = SweepConfig.model_validate(given)
    except ValidationError as error:
        first = error.errors()[0]
        line = _line(text, first["loc"], first["msg"])
        raise ConfigError(f"{source}{line}: {_message(first)}") from error
    for index, product in enumerate(config.products()):
        if not product.cells():
            loc = ("starts",) if index == 0 else ("more", index - 1, "starts")
            choices = "; ".join(f"{solver}: {', '.join(starts_of(solver))}" for solver in product.solvers)
            raise ConfigError(
                f"{source}{_line(text, loc, '')}: {_key(loc)}: expected starts that some solver has ({choices}), got "
                f"{', '.join(product.starts)}: not one cell is left"
            )
    return config


def _message(error: ErrorDetails) -> str:
    loc = error["loc"]
    model = Product if "more" in loc else SweepConfig
    if error["type"] == "extra_forbidden":
        return f"expected keys among {', '.join(model.model_fields)}, got {_key(loc)!r}"
    message = error["msg"].removeprefix("Value error, ")
    if error["type"] == "too_short" and str(loc[-1]) in CHOICES:
        message = f"expected at least one of {', '.join(CHOICES[str(loc[-1])]())}, or {ALL!r}, got an empty list"
    elif error["type"] == "too_short":
        message = f"expected at least one of {', '.join(STARTS)}, got an empty list"
    return f"{_key(loc)}: {message}"


def _key(loc: tuple[int | str, ...]) -> str:
    return ".".join(str(part) for part in loc)


def _line(text: str, loc: tuple[int | str, ...], message: str) -> str:
    """Say on which line of a TOML text a key, or the name in its list that a message is about, stands."""
    lines = text.splitlines()
    key = next((part for part in reversed(loc) if isinstance(part, str) and part != "more"), "more")
    table = -1  # before the first [[more]]
    wanted = loc[1] if loc[:1] == ("more",) and len(loc) > 1 else -1
    start = None
    for number, line in enumerate(lines):
        if re.match(r"\s*\[\[\s*more\s*\]\]", line):
            table += 1
        if table == wanted and re.match(rf"""\s*["']?{re.escape(key)}["']?\s*=""", line):
            start = number
            break
    if start is None:
        return ""
    found = start
    for number in range(start, len(lines)):
        if number > start and re.match(r"\s*(\[\[|[\w\"'-]+\s*=)", lines[number]):
            break
        for one, other in re.findall(r'"([^"]*)"|\'([^\']*)\'', lines[number].partition("#")[0]):
            name = one or other
            # Named as what was got; choices stand in messages without quotes.
            if f"{name.partition('(')[0]!r}" in message or f"twice: {name}" in message:
                found = number
    return f", line {found + 1}"
