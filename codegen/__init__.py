"""A formulation on a robot as C: generating it, compiling and loading it, exporting it."""

from .compile_step import compile_step
from .definite import CurvatureError
from .examples import ExportError
from .export import export_c
from .results import BatchResult, TickResult
from .step import CompiledStep

__all__ = ["BatchResult", "CompiledStep", "CurvatureError", "ExportError", "TickResult", "compile_step", "export_c"]
