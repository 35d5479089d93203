"""The thesis's experiment again: algorithms A, B and C under simulated hands, measured and compared."""

from .plan import path_of, study_settings
from .result import ALGORITHMS, StudyError, StudyResult, StudySettings
from .trials import run_study

__all__ = ["ALGORITHMS", "StudyError", "StudyResult", "StudySettings", "path_of", "run_study", "study_settings"]
