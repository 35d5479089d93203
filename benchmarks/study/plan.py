"""Who does what in a study: persons, the order of algorithms, single trials."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from ...baselines import is_baseline
from ...control import CHARACTERS, Character, GuidedRun, Operator, SemicirclePath, make_guiding, simulate_guiding
from ...formulations import DEFAULT_DT
from ...robots import load_robot
from ..scenarios.semicircle import RADIUS, START_DEG
from .outcomes import outcomes_of
from .result import ALGORITHMS, StudyError, StudySettings

if TYPE_CHECKING:
    from ...control import CompiledGuiding, GuidingController

#: The thesis's subjects by their experience with hand-guided robots (table 5.1), and whom we take them for.
EXPERIENCE: Final = {"never": 11, "<5 trials": 8, "<20 trials": 4, "regular": 19}
_NOVICES: Final = ("never", "<5 trials")
# The person stands in front of the robot (thesis 5.2): away from its base, along x.
_STANCE: Final = (1.0, 0.0, 0.0)
# So that the streams of one seed don't meet.
_PERSONS, _ORDERS, _TRIALS, _ROLES = range(4)


class Trial(NamedTuple):
    """One trial: algorithm's letter, operator and number (from 0)."""

    algorithm: str
    operator: int
    number: int

    @property
    def name(self) -> str:
        """What its file is called."""
        return f"{self.algorithm}-{self.operator:03d}-{self.number}"

    @staticmethod
    def parse(name: str) -> Trial:
        """Make it of its name."""
        algorithm, operator, number = name.split("-")
        return Trial(algorithm, int(operator), int(number))


def study_settings(
    *, operators: int = 42, trials: int = 3, seed: int = 2018, time_limit: float = 30.0, dt: float = DEFAULT_DT
) -> StudySettings:
    """Settings of the thesis's experiment (5.2): 42 subjects, three trials with each algorithm, the semicircle.

    Of the subjects, those who had never guided a robot or fewer than five times (19 of 42 in table 5.1) are taken for
    novices, the others (23) for experts; other numbers of operators are split in this proportion, rounded.

    Raises
    ------
    StudyError
        When a number makes no sense.
    """
    if operators < 1 or trials < 1 or seed < 0:
        raise StudyError(f"expected at least one operator and trial and a seed >= 0, got {operators}, {trials}, {seed}")
    if not (time_limit >= 1.0 and 0.0 < dt <= 0.01):
        raise StudyError(f"expected a time limit of 1 s at least and a dt up to 0.01 s, got {time_limit}, {dt}")
    robot = load_robot("lbr_med14")
    share = sum(EXPERIENCE[name] for name in _NOVICES) / sum(EXPERIENCE.values())
    novices = round(operators * share)
    limits: dict[str, Any] = {
        name: tuple(getattr(robot, name).tolist()) for name in ("q_min", "q_max", "qd_max", "qdd_max", "tau_max")
    }
    return StudySettings(
        robot=robot.name,
        mode="fix-orientation",
        algorithms=dict(ALGORITHMS),
        dt=dt,
        q0=tuple(np.deg2rad(START_DEG).tolist()),
        radius=RADIUS,
        elbow=3,
        seed=seed,
        operators=operators,
        trials=trials,
        characters={name: character.parameters() for name, character in CHARACTERS.items()},
        counts={"expert": operators - novices, "novice": novices},
        time_limit=time_limit,
        **limits,
    )


def trials_of(settings: StudySettings) -> tuple[Trial, ...]:
    """All trials, operator by operator, each with his own order of algorithms."""
    return tuple(
        Trial(algorithm, operator, number)
        for operator in range(settings.operators)
        for algorithm in order_of(settings, operator)
        for number in range(settings.trials)
    )


def order_of(settings: StudySettings, operator: int) -> tuple[str, ...]:
    """The order in which an operator has the algorithms: drawn (thesis 5.2, "randomly changed between subjects")."""
    rng = np.random.default_rng((settings.seed, _ORDERS, operator))
    return tuple(str(letter) for letter in rng.permutation(sorted(settings.algorithms)))


def person(settings: StudySettings, operator: int) -> Character:
    """The person that an operator is: whose character is drawn such that the counts hold, and himself from that."""
    roles = [name for name, count in settings.counts.items() for _ in range(count)]
    np.random.default_rng((settings.seed, _ROLES)).shuffle(roles)
    name = roles[operator]
    rng = np.random.default_rng((settings.seed, _PERSONS, operator))
    return Character(name=name, **settings.characters[name]).individual(rng)


@dataclass(frozen=True)
class Course:
    """The robot, the path, and the controllers of the algorithms, made once and used for trial after trial.

    Attributes
    ----------
    settings : StudySettings
    path : SemicirclePath
        As in the scenario `semicircle`.
    controllers : dict of str to GuidingController or CompiledGuiding
    """

    settings: StudySettings
    path: SemicirclePath
    controllers: dict[str, GuidingController | CompiledGuiding]

    @staticmethod
    def of(settings: StudySettings) -> Course:
        """Make it; formulations are compiled."""
        robot = load_robot(settings.robot)
        path = path_of(settings)
        controllers = {
            letter: make_guiding(robot, name, [settings.mode], compiled=not is_baseline(name), dt=settings.dt)
            for letter, name in settings.algorithms.items()
        }
        return Course(settings, path, controllers)

    def run(self, trial: Trial) -> tuple[GuidedRun, bool]:
        """Run a trial; and whether the tool arrived.

        Tremor, and the order in which a person tries sides, depend on person and trial, not on the algorithm.
        """
        settings = self.settings
        operator = Operator(
            self.path,
            person(settings, trial.operator),
            seed=(settings.seed, _TRIALS, trial.operator, trial.number),
            stance=_STANCE,
        )
        run = simulate_guiding(self.controllers[trial.algorithm], operator, settings.q0, settings.time_limit)
        return run, operator.finished(len(run.t) * settings.dt)

    def row(self, trial: Trial) -> dict[str, Any]:
        """Run a trial and measure it: its row of `StudyResult.trials`."""
        run, finished = self.run(trial)
        measured = outcomes_of(run, self.path, self.settings.elbow, finished=finished)
        return {
            "algorithm": trial.algorithm,
            "operator": trial.operator,
            "character": person(self.settings, trial.operator).name,
            "trial": trial.number,
            "order": order_of(self.settings, trial.operator).index(trial.algorithm),
            **measured,
        }


def path_of(settings: StudySettings) -> SemicirclePath:
    """The semicircle of a study, vertical, from where the tool is at `q0`."""
    start = load_robot(settings.robot).pose(settings.q0)[:3, 3]
    return SemicirclePath(start, np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]), settings.radius)
