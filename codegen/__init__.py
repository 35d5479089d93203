"""A formulation on a robot as C: generating it, compiling and loading it, exporting it."""

from .definite import CurvatureError
from .export import ExportError, export_c
from .step import BatchResult, CompiledStep, TickResult, compile_step

__all__ = ["BatchResult", "CompiledStep", "CurvatureError", "ExportError", "TickResult", "compile_step", "export_c"]
