"""What a study found, and its folder: `settings.json`, `trials.parquet`, `runs/X.parquet`."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import polars as pl

from ..reading import read_frame, read_object
from ..store import parquet, write_whole
from .run_frame import frame_of, run_of, torque_of

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from ...control import GuidedRun

    Array = NDArray[np.float64]

#: The thesis's algorithms (5.1) by the names that they are registered under.
ALGORITHMS: Final[dict[str, str]] = {"A": "task-priority", "B": "saturation-null-space", "C": "joint-space"}

_FORMAT: Final = 1
_ANEW: Final = "take it from a copy, or run the study again with --resume"
#: Columns of `StudyResult.trials`, in order.
TRIAL_COLUMNS: Final[dict[str, pl.DataType]] = {
    "algorithm": pl.String(),
    "operator": pl.Int64(),
    "character": pl.String(),
    "trial": pl.Int64(),
    "order": pl.Int64(),
    "finished": pl.Boolean(),
    "time": pl.Float64(),
    "stops": pl.Int64(),
    "standing": pl.Float64(),
    "peak_qdd": pl.Float64(),
    "peak_qdd_joint": pl.Int64(),
    "elbow_peak_qdd": pl.Float64(),
    "rms_qdd": pl.Float64(),
    "peak_torque": pl.Float64(),
    "rms_torque": pl.Float64(),
    "peak_torque_rate": pl.Float64(),
    "work_against": pl.Float64(),
    "path_error_rms": pl.Float64(),
    "unexpected": pl.Int64(),
    "drift_mm": pl.Float64(),
    "drift_deg": pl.Float64(),
    "unsolved": pl.Int64(),
}


class StudyError(RuntimeError):
    """A study's folder can't be used as asked; the message says what to do."""


@dataclass(frozen=True)
class StudySettings:
    """What a study was run with; as JSON it is the same again.

    Attributes
    ----------
    robot, mode : str
        As for `load_robot` and `Mode.parse`.
    algorithms : dict of str to str
        Formulation or baseline by the algorithm's letter.
    dt : float
        Control period [s].
    q0 : tuple of float
        Where every trial begins, at rest [rad].
    radius : float
        Of the semicircle [m].
    elbow : int
        The joint (from 0) whose limit the path leads into.
    seed : int
        All randomness follows from it.
    operators, trials : int
        How many hands, and how many trials each has with each algorithm.
    characters : dict of str to dict
        Parameters of the hands by character, as fields of `kinqp.control.Character`.
    counts : dict of str to int
        How many operators have each character.
    time_limit : float
        A trial that has not finished by then is ended [s].
    q_min, q_max, qd_max, qdd_max, tau_max : tuple of float
        Limits of the joints [rad, rad/s, rad/s^2, Nm].
    representative : tuple of int
        Operator and trial of which `StudyResult.runs` are.
    """

    robot: str
    mode: str
    algorithms: dict[str, str]
    dt: float
    q0: tuple[float, ...]
    radius: float
    elbow: int
    seed: int
    operators: int
    trials: int
    characters: dict[str, dict[str, float]]
    counts: dict[str, int]
    time_limit: float
    q_min: tuple[float, ...]
    q_max: tuple[float, ...]
    qd_max: tuple[float, ...]
    qdd_max: tuple[float, ...]
    tau_max: tuple[float, ...]
    representative: tuple[int, int] = (0, 0)

    @staticmethod
    def from_json(content: Mapping[str, Any]) -> StudySettings:
        """Make them of what `json.loads` gives: lists become tuples again.

        Raises
        ------
        StudyError
            When fields are missing or unknown.
        """
        names = {field.name for field in fields(StudySettings)}
        if set(content) != names:
            raise StudyError(f"settings: expected the fields {sorted(names)}, got {sorted(content)}")
        made: dict[str, Any] = {name: tuple(v) if isinstance(v, list) else v for name, v in content.items()}
        return StudySettings(**made)


@dataclass(frozen=True)
class StudyResult:
    """What a study found.

    Attributes
    ----------
    trials : polars.DataFrame
        One row per trial, columns `TRIAL_COLUMNS`:

        - `algorithm` ("A", "B", "C"), `operator` (from 0), `character` ("expert", "novice"), `trial` (from 0),
          `order`: which of the three this operator had this algorithm as (from 0).
        - `finished`: whether the tool arrived; `time` until it did, or until the trial was ended [s]; `stops`: how
          often the tool stood still although the hand pulled, `standing`: for how long in all [s].
        - `peak_qdd`: largest joint acceleration, `peak_qdd_joint`: whose (from 0), `elbow_peak_qdd`, `rms_qdd`: over
          ticks and joints [rad/s^2].
        - `peak_torque`, `rms_torque`: of the joints, by inverse dynamics [Nm], `peak_torque_rate` [Nm/s].
        - `work_against`: what the hand did against the motion [J]; `path_error_rms`: distance from the path [m].
        - `unexpected`: ticks at which v . v_actual < 0; `drift_mm`, `drift_deg`: largest, of the locked rows.
        - `unsolved`: ticks at which the safe stop was sent.
    runs : dict of str to GuidedRun
        By algorithm: the representative trial, of the same operator and number for all.
    torques : dict of str to ndarray, shape (N, nv)
        Joint torques of these runs [Nm].
    settings : StudySettings
    """

    trials: pl.DataFrame
    runs: dict[str, GuidedRun]
    torques: dict[str, Array]
    settings: StudySettings

    def write(self, folder: Path) -> None:
        """Write it to a folder, made if need be; `settings.json` comes last, so a folder with one is whole."""
        (folder / "runs").mkdir(parents=True, exist_ok=True)
        (folder / "settings.json").unlink(missing_ok=True)
        write_whole(folder / "trials.parquet", parquet(self.trials))
        for letter, run in self.runs.items():
            write_whole(folder / "runs" / f"{letter}.parquet", parquet(frame_of(run, self.torques[letter])))
        content = {
            "format": _FORMAT,
            "settings": asdict(self.settings),
            "q_end": {letter: run.q_end.tolist() for letter, run in self.runs.items()},
        }
        write_whole(folder / "settings.json", (json.dumps(content, indent=1) + "\n").encode())

    @staticmethod
    def read(folder: Path) -> StudyResult:
        """Read what `write` wrote.

        Raises
        ------
        StudyError
            When there is no whole study in the folder.
        """
        path = folder / "settings.json"
        try:
            content = read_object(path, _ANEW)
        except OSError as error:
            raise StudyError(f"{folder}: expected a study's settings.json there: {error}") from error
        if content.get("format") != _FORMAT:
            raise StudyError(f"{path}: expected format {_FORMAT}, got {content.get('format')!r}")
        settings = StudySettings.from_json(content["settings"])
        trials = read_frame(folder / "trials.parquet", _ANEW)
        if dict(trials.schema) != TRIAL_COLUMNS:
            raise StudyError(f"{folder / 'trials.parquet'}: expected columns {TRIAL_COLUMNS}, got {trials.schema}")
        frames = {letter: read_frame(folder / "runs" / f"{letter}.parquet", _ANEW) for letter in content["q_end"]}
        runs = {
            letter: run_of(frame, settings.robot, settings.dt, np.array(content["q_end"][letter]))
            for letter, frame in frames.items()
        }
        return StudyResult(trials, runs, {letter: torque_of(frame) for letter, frame in frames.items()}, settings)
