import json
from dataclasses import replace

import polars as pl
import pytest

from kinqp.benchmarks.study import StudyError, StudyResult, run_study, study_settings
from kinqp.benchmarks.study.trials import representative

SETTINGS = study_settings(operators=1, trials=1, time_limit=1.0)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A study of three trials, one second each, in one process: its folder, its result, and what was told."""
    folder, told = tmp_path_factory.mktemp("study"), []
    result = run_study(SETTINGS, folder, processes=1, on_trial=lambda done, total: told.append((done, total)))
    return folder, result, told


def test_a_study_has_a_row_for_every_trial_and_a_run_for_every_algorithm(study):
    _, result, told = study
    assert told == [(0, 3), (1, 3), (2, 3), (3, 3)]
    assert result.trials["algorithm"].to_list() == ["A", "B", "C"]
    assert result.trials["time"].to_list() == [1.0, 1.0, 1.0]
    assert not result.trials["finished"].any()
    assert sorted(result.trials["order"]) == [0, 1, 2]
    assert result.settings.representative == (0, 0)
    for letter, run in result.runs.items():
        assert run.q.shape == result.torques[letter].shape == (1000, 7)
        row = result.trials.row(by_predicate=pl.col("algorithm") == letter, named=True)
        assert row["peak_qdd"] == pytest.approx(abs(run.acceleration()).max(), rel=1e-12)


def test_the_folder_holds_the_result(study):
    folder, result, _ = study
    read = StudyResult.read(folder)
    assert read.trials.equals(result.trials)
    assert read.settings == result.settings


def test_a_study_is_resumed_where_it_was_interrupted_with_the_same_result(study):
    folder, result, _ = study
    names = sorted((folder / "trials").iterdir())
    kept, lost = names[0], names[1:]
    before = kept.stat().st_mtime_ns
    for name in lost:
        name.unlink()
    (folder / "settings.json").unlink()
    (folder / "trials" / "B-000-0.jsonxyz.partial").touch()
    told = []
    again = run_study(SETTINGS, folder, processes=2, resume=True, on_trial=lambda done, _: told.append(done))
    assert told == [1, 2, 3]
    assert again.trials.equals(result.trials)
    assert kept.stat().st_mtime_ns == before
    assert sorted((folder / "trials").iterdir()) == names


def test_a_folder_with_a_study_is_not_written_over_unasked(study):
    folder, _, _ = study
    with pytest.raises(StudyError, match="--resume"):
        run_study(SETTINGS, folder)
    with pytest.raises(StudyError, match="other settings"):
        run_study(replace(SETTINGS, seed=9), folder, resume=True)
    with pytest.raises(StudyError, match="either"):
        run_study(SETTINGS, folder, resume=True, overwrite=True)
    assert len(list((folder / "trials").iterdir())) == 3


def test_a_trial_that_fails_is_named_with_its_reason(tmp_path):
    with pytest.raises(StudyError, match=r"trial [A]-000-0: .*nonsense"):
        run_study(replace(SETTINGS, algorithms={"A": "nonsense"}), tmp_path, processes=1)
    assert not (tmp_path / "settings.json").exists()
    assert json.loads((tmp_path / "plan.json").read_text())["algorithms"] == {"A": "nonsense"}


def test_no_process_runs_no_study(tmp_path):
    with pytest.raises(StudyError, match="processes"):
        run_study(SETTINGS, tmp_path, processes=0)


def test_the_representative_trial_is_the_one_nearest_to_the_median_with_every_algorithm():
    times = {"A": [5.0, 6.0, 7.0, 8.0, 9.0], "B": [30.0, 9.0, 12.0, 10.0, 20.0], "C": [1.0, 2.0, 3.0, 5.0, 4.0]}
    rows = [
        {"algorithm": letter, "operator": k // 2, "trial": k % 2, "time": time}
        for letter, column in times.items()
        for k, time in enumerate(column)
    ]
    # Ranks off the middle: A 2 1 0 1 2, B 2 2 0 1 1, C 2 1 0 2 1.
    assert representative(pl.DataFrame(rows)) == (1, 0)
