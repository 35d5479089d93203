"""A study to draw, and its page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from kinqp.benchmarks.study.write import Written, write_study
from tests.benchmarks.study.synthetic import synthetic

if TYPE_CHECKING:
    from kinqp.benchmarks.study import StudyResult


@pytest.fixture(scope="session")
def study() -> StudyResult:
    return synthetic()


@pytest.fixture(scope="session")
def written(study: StudyResult, tmp_path_factory: pytest.TempPathFactory) -> Written:
    return write_study(study, tmp_path_factory.mktemp("study"), {"cpu": "a test's", "date": "today", "git": "none"})
