"""Where a sweep lives on disk: a manifest and one Parquet file per cell, each written whole or not at all."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import polars as pl

from .config import SweepConfig

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ..control import Trajectory

    Array = NDArray[np.float64]

_FORMAT: Final = 1
_TIMES: Final = ("setup_time", "solve_time")


class StoreError(ValueError):
    """A results folder can't be used as asked; the message says what to do."""


@dataclass(frozen=True, order=True)
class Cell:
    """One scenario x formulation x solver."""

    scenario: str
    formulation: str
    solver: str

    def __str__(self) -> str:
        """Write it for people."""
        return f"{self.scenario} / {self.formulation} / {self.solver}"

    @property
    def file_name(self) -> str:
        """Name of its Parquet file: readable, and different for different cells."""
        parts = (self.scenario, self.formulation, self.solver)
        return "__".join(re.sub(r"[^\w=.,+-]", "_", part) for part in parts) + ".parquet"


def cells_of(config: SweepConfig) -> tuple[Cell, ...]:
    """All cells of a sweep, in the order of its lists."""
    return tuple(Cell(a, b, c) for a in config.scenarios for b in config.formulations for c in config.solvers)


class Store:
    """A results folder.

    Parameters
    ----------
    folder : Path
        Made when a sweep is begun in it.
    """

    def __init__(self, folder: Path) -> None:
        self.folder: Final = folder

    @property
    def _manifest(self) -> Path:
        return self.folder / "manifest.json"

    def begin(self, config: SweepConfig, conditions: dict[str, str], *, resume: bool, overwrite: bool) -> None:
        """Prepare the folder for a sweep.

        Raises
        ------
        StoreError
            When it holds a sweep and neither `resume` nor `overwrite` is asked for, or `resume` is and the sweep there
            has another configuration or was measured elsewhere.
        """
        if resume and overwrite:
            raise StoreError(f"{self.folder}: expected either --resume or --overwrite, got both")
        if self._manifest.exists() and not overwrite:
            self._check_resumable(config, conditions, resume=resume)
            return
        (self.folder / "cells").mkdir(parents=True, exist_ok=True)
        for old in (self.folder / "cells").glob("*.parquet"):
            old.unlink()
        manifest = {"format": _FORMAT, "config": config.model_dump(mode="json"), "conditions": conditions}
        _write_whole(self._manifest, (json.dumps(manifest, indent=2) + "\n").encode())

    def _check_resumable(self, config: SweepConfig, conditions: dict[str, str], *, resume: bool) -> None:
        stored, stored_conditions = self.manifest()
        if not resume:
            raise StoreError(
                f"{self.folder} holds a sweep already: give --resume to continue it, --overwrite to replace it, "
                "or another folder with --out"
            )
        if stored != config:
            raise StoreError(f"{self.folder} holds a sweep with another configuration: expected the same to resume it")
        for key, value in stored_conditions.items():
            if key != "date" and conditions.get(key) != value:
                raise StoreError(
                    f"{self.folder} was measured with {key} {value!r} and this is {conditions.get(key)!r}: "
                    "times of the two don't belong into one table; give another folder with --out"
                )

    def manifest(self) -> tuple[SweepConfig, dict[str, str]]:
        """Configuration and conditions of the sweep in the folder.

        Raises
        ------
        StoreError
            When there is none, or it can't be read.
        """
        try:
            manifest: dict[str, Any] = json.loads(self._manifest.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
            raise StoreError(f"{self.folder}: expected a sweep's manifest.json there: {error}") from error
        if manifest.get("format") != _FORMAT:
            raise StoreError(f"{self._manifest}: expected format {_FORMAT}, got {manifest.get('format')!r}")
        return SweepConfig.model_validate(manifest["config"]), dict(manifest["conditions"])

    def repeats_done(self, cell: Cell) -> int:
        """How many timed runs of a cell the folder holds."""
        path = self._path(cell)
        if not path.exists():
            return 0
        width = pl.read_parquet_schema(path)["solve_time"]
        return int(width.size) if isinstance(width, pl.Array) else 0

    def add(self, cell: Cell, run: Trajectory) -> None:
        """Add a timed run to a cell.

        Raises
        ------
        StoreError
            When its commands differ from those of the runs before: the controller isn't deterministic, and times of
            different problems would be mixed.
        """
        frame = to_frame(run)
        path = self._path(cell)
        if path.exists():
            before = pl.read_parquet(path)
            if not np.array_equal(before["qd"].to_numpy(), frame["qd"].to_numpy()):
                raise StoreError(f"{cell}: expected the same commands in every run, got different ones")
            frame = before.with_columns(
                pl.Series(name, np.hstack([before[name].to_numpy(), frame[name].to_numpy()])).cast(
                    pl.Array(pl.Float64, before[name].to_numpy().shape[1] + 1)
                )
                for name in _TIMES
            )
        temporary = path.with_suffix(".partial")
        frame.write_parquet(temporary, compression="zstd")
        temporary.replace(path)

    def read(self, cell: Cell) -> pl.DataFrame:
        """Ticks of a cell, one per row; see `to_frame`."""
        return pl.read_parquet(self._path(cell))

    def _path(self, cell: Cell) -> Path:
        return self.folder / "cells" / cell.file_name


def to_frame(run: Trajectory) -> pl.DataFrame:
    """One row per tick.

    Columns: `t` [s]; `q`, `qd` [rad or m, .../s], `v`, `eps` [m/s, rad/s], `position` [m] as arrays; `fixed_error`,
    `bound_violation`, `sigma_min`, `iterations`, `status`, `message`, `active` (names of rows); `setup_time` and
    `solve_time` [s] as arrays with one entry per timed run.
    """
    columns: dict[str, pl.Series] = {
        "t": pl.Series(run.t),
        "status": pl.Series([status.value for status in run.status]),
        "message": pl.Series(list(run.message)),
        "active": pl.Series([list(names) for names in run.active], dtype=pl.List(pl.String)),
        "iterations": pl.Series(run.iterations),
    }
    for name in ("fixed_error", "bound_violation", "sigma_min"):
        columns[name] = pl.Series(getattr(run, name))
    for name in ("q", "qd", "v", "eps", "position"):
        columns[name] = _array_series(getattr(run, name))
    for name in _TIMES:
        columns[name] = _array_series(getattr(run, name)[:, None])
    return pl.DataFrame(columns)


def _array_series(values: Array) -> pl.Series:
    return pl.Series(np.ascontiguousarray(values), dtype=pl.Array(pl.Float64, values.shape[1]))


def _write_whole(path: Path, content: bytes) -> None:
    temporary = path.with_suffix(".partial")
    temporary.write_bytes(content)
    temporary.replace(path)
