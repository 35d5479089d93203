"""The da Vinci arm study: a student report's jobs (N. Adaloglou, 2017/2018), done with this library and compared."""

from .run import run_davinci

__all__ = ["run_davinci"]
