"""A small study to draw: one real run of each algorithm, and trials scattered around their measures."""

from functools import cache

import numpy as np
import polars as pl

from kinqp.benchmarks import get_scenario
from kinqp.benchmarks.study import ALGORITHMS, StudyResult, StudySettings
from kinqp.benchmarks.study.result import TRIAL_COLUMNS
from kinqp.control import EXPERT, GuidedRun, Operator, make_guiding, simulate_guiding

SCENARIO = get_scenario("semicircle")
OPERATORS, TRIALS = 8, 2
# Coarser than a controller runs, to be quick.
DT = 5e-3


def _run(algorithm: str) -> GuidedRun:
    (phase,) = SCENARIO.phases
    controller = make_guiding(SCENARIO.robot, algorithm, ["fix-orientation"], dt=DT)
    hand = Operator(phase.guide.path, EXPERT, seed=5, stance=(1.0, 0.0, 0.0))
    return simulate_guiding(controller, hand, SCENARIO.q0, 20.0)


def torques_of(run: GuidedRun) -> np.ndarray:
    rows = zip(run.q, run.qd, run.acceleration(), strict=True)
    return np.array([run.robot.mass_matrix(q) @ a + run.robot.bias_forces(q, qd) for q, qd, a in rows])


def settings() -> StudySettings:
    robot = SCENARIO.robot
    limits = {n: tuple(getattr(robot, n).tolist()) for n in ("q_min", "q_max", "qd_max", "qdd_max", "tau_max")}
    return StudySettings(
        robot="lbr_med14", mode="fix-orientation", algorithms=dict(ALGORITHMS), dt=DT,
        q0=tuple(SCENARIO.q0.tolist()), radius=0.3, elbow=3, seed=7, operators=OPERATORS, trials=TRIALS,
        characters={"expert": {"stiffness": 300.0}, "novice": {"stiffness": 500.0}},
        counts={"expert": OPERATORS // 2, "novice": OPERATORS - OPERATORS // 2}, time_limit=20.0,
        representative=(1, 0), **limits,
    )  # fmt: skip


def trials(runs: dict[str, GuidedRun], torques: dict[str, np.ndarray]) -> pl.DataFrame:
    """Each algorithm's run, its measures drawn a little apart for every trial."""
    rng = np.random.default_rng(3)
    rows = []
    for letter, run in runs.items():
        qdd, torque = np.abs(run.acceleration()), np.abs(torques[letter])
        still = float(np.mean(np.linalg.norm(run.twist[:, :3], axis=1) < 1e-3) * run.t[-1])
        measured = {
            "time": run.t[-1] + still, "standing": still, "peak_qdd": qdd.max(), "elbow_peak_qdd": qdd[:, 3].max(),
            "rms_qdd": np.sqrt(np.mean(qdd**2)), "peak_torque": torque.max(),
            "rms_torque": np.sqrt(np.mean(torque**2)),
            "peak_torque_rate": np.abs(np.diff(torque, axis=0)).max() / run.dt, "work_against": 0.1 + still,
            "path_error_rms": 0.01,
        }  # fmt: skip
        for operator in range(OPERATORS):
            for trial in range(TRIALS):
                near = {name: float(value * rng.uniform(0.9, 1.0)) for name, value in measured.items()}
                rows.append(
                    {
                        "algorithm": letter,
                        "operator": operator,
                        "character": "expert" if operator < OPERATORS // 2 else "novice",
                        "trial": trial,
                        "order": (operator + list(ALGORITHMS).index(letter)) % 3,
                        "finished": True,
                        "stops": 2 if letter == "B" else 0,
                        "peak_qdd_joint": int(qdd.max(axis=0).argmax()),
                        "unexpected": 0,
                        "drift_mm": 0.01,
                        "drift_deg": 0.001,
                        "unsolved": 0,
                        **near,
                    }
                )
    return pl.DataFrame(rows, schema=TRIAL_COLUMNS)


@cache
def synthetic() -> StudyResult:
    """The study; made once."""
    runs = {letter: _run(algorithm) for letter, algorithm in ALGORITHMS.items()}
    torques = {letter: torques_of(run) for letter, run in runs.items()}
    return StudyResult(trials(runs, torques), runs, torques, settings())
