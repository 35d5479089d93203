from collections import Counter

import numpy as np
import pytest

from kinqp.benchmarks.scenarios.semicircle import semicircle
from kinqp.benchmarks.study import StudyError, path_of, study_settings
from kinqp.benchmarks.study.plan import Trial, order_of, person, trials_of


def test_42_operators_are_split_as_the_thesis_subjects_are():
    settings = study_settings()
    assert settings.counts == {"expert": 23, "novice": 19}
    assert Counter(person(settings, k).name for k in range(42)) == settings.counts


@pytest.mark.parametrize(("operators", "novices"), [(1, 0), (2, 1), (10, 5), (84, 38)])
def test_other_numbers_are_split_in_proportion(operators, novices):
    assert study_settings(operators=operators).counts == {"expert": operators - novices, "novice": novices}


def test_there_are_378_trials_each_once():
    settings = study_settings()
    trials = trials_of(settings)
    assert len(trials) == len(set(trials)) == 42 * 3 * 3
    assert all(Trial.parse(trial.name) == trial for trial in trials)


def test_the_order_of_algorithms_changes_between_operators():
    settings = study_settings()
    orders = [order_of(settings, k) for k in range(42)]
    assert all(sorted(order) == ["A", "B", "C"] for order in orders)
    assert len(set(orders)) == 6
    firsts = Counter(order[0] for order in orders)
    assert min(firsts.values()) >= 7
    # A person has all trials with an algorithm one after the other.
    mine = [trial.algorithm for trial in trials_of(settings) if trial.operator == 5]
    assert mine == [letter for letter in orders[5] for _ in range(3)]


def test_persons_follow_from_the_seed():
    settings, other = study_settings(), study_settings(seed=7)
    assert person(settings, 3) == person(study_settings(), 3)
    assert person(settings, 3) != person(settings, 4)
    assert person(settings, 3) != person(other, 3)


def test_the_path_is_the_scenarios():
    path, scenario = path_of(study_settings()), semicircle()
    for s in np.linspace(0.0, path.length, 5):
        np.testing.assert_allclose(path.point(s), scenario.guide.path.point(s), atol=1e-12)
    np.testing.assert_allclose(study_settings().q0, scenario.q0)


@pytest.mark.parametrize("wrong", [{"operators": 0}, {"trials": 0}, {"seed": -1}, {"time_limit": 0.1}, {"dt": 0.0}])
def test_impossible_settings_are_refused(wrong):
    with pytest.raises(StudyError, match="expected"):
        study_settings(**wrong)
