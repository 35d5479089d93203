"""The thesis's experiment again: algorithms A, B and C under simulated hands, measured and compared."""

from .result import ALGORITHMS, StudyError, StudyResult, StudySettings

__all__ = ["ALGORITHMS", "StudyError", "StudyResult", "StudySettings"]
