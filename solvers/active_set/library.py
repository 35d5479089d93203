"""The C sources as text, and the shared library made of them."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Any

from ..native import build_library, declarations

#: The canonical QP and the least-distance core, sizes known at run time.
_RUN_TIME = (
    "kinqp_status.h",
    "kinqp_as.h",
    "kinqp_as.c",
    "kinqp_as_factor.inc",
    "kinqp_as_core.inc",
    "kinqp_as_primal.inc",
    "kinqp_qp.h",
    "kinqp_qp_internal.h",
    "kinqp_qp.c",
    "kinqp_qp_factor.c",
    "kinqp_qp_reduce.c",
    "kinqp_qp_residual.c",
)

#: The least-distance core alone, sizes known at compile time: all to be included, nothing to be compiled by itself.
_FIXED_SIZE = ("kinqp_status.h", "kinqp_as.h", "kinqp_as_fixed.h", "kinqp_as_factor.inc", "kinqp_as_core.inc")

_HEADERS = ("kinqp_status.h", "kinqp_as.h", "kinqp_qp.h")


def sources() -> dict[str, str]:
    """Return the C of the solver for sizes known at run time, text by file name."""
    return _read(_RUN_TIME)


def fixed_size_sources() -> dict[str, str]:
    """Return the C of the least-distance core for sizes known at compile time, text by file name.

    A translation unit defines ``KINQP_AS_N`` and ``KINQP_AS_M`` and includes ``kinqp_as_fixed.h``.
    """
    return _read(_FIXED_SIZE)


@cache
def load() -> tuple[Any, Any]:
    """Build the solver if need be, and return cffi's ``(ffi, lib)`` for it.

    Raises
    ------
    CompilerError
        When it cannot be built.
    """
    import cffi

    texts = sources()
    ffi = cffi.FFI()
    for header in _HEADERS:
        ffi.cdef(declarations(texts[header]))
    return ffi, ffi.dlopen(str(build_library("kinqp_active_set", texts)))


def _read(names: tuple[str, ...]) -> dict[str, str]:
    folder = files(__package__)
    return {name: folder.joinpath(name).read_text(encoding="utf-8") for name in names}
