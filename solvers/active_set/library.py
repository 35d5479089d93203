"""The C sources as text, and the shared library made of them."""

from __future__ import annotations

import re
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
    "kinqp_as_steps.inc",
    "kinqp_as_core.inc",
    "kinqp_as_primal.inc",
    "kinqp_qp.h",
    "kinqp_qp_internal.h",
    "kinqp_qp.c",
    "kinqp_qp_factor.c",
    "kinqp_qp_passes.c",
    "kinqp_qp_reduce.c",
    "kinqp_qp_residual.c",
    "kinqp_qp_scale.c",
)

#: The least-distance core alone, sizes known at compile time: all to be included, nothing to be compiled by itself.
_FIXED_SIZE = (
    "kinqp_status.h",
    "kinqp_as.h",
    "kinqp_as_fixed.h",
    "kinqp_as_factor.inc",
    "kinqp_as_steps.inc",
    "kinqp_as_core.inc",
)

_HEADERS = ("kinqp_status.h", "kinqp_as.h", "kinqp_qp.h")

_INCLUDE = re.compile(r'^#include "([^"]+)"\n', flags=re.MULTILINE)
_SYSTEM = re.compile(r"^#include <[^>]+>\n", flags=re.MULTILINE)
_FUNCTION = re.compile(r"^(?:int|void|double|size_t|kinqp_\w+) \*?kinqp_\w+\(", flags=re.MULTILINE)
_LINKAGE_BEGIN = '#ifdef __cplusplus\nextern "C" {\n#endif\n\n'
_LINKAGE_END = "#ifdef __cplusplus\n}\n#endif\n"


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


def embedded_source(inline: str) -> str:
    """Return the C of the solver for sizes known at run time as one text, all of its functions private.

    Parameters
    ----------
    inline : str
        What to declare every function as, such as "static inline". Some of them are not called by the others.
    """
    texts = sources()
    order = ("kinqp_as.h", "kinqp_qp.h", "kinqp_qp_internal.h", *(name for name in _RUN_TIME if name.endswith(".c")))
    text = "\n".join(texts[name] for name in order)
    text = _INCLUDE.sub(lambda match: texts[match[1]] if match[1].endswith(".inc") else "", text)
    text = _SYSTEM.sub("", text).replace(_LINKAGE_BEGIN, "").replace(_LINKAGE_END, "")
    return _FUNCTION.sub(rf"{inline} \g<0>", text)


def workspace_doubles(n: int, p: int, m: int) -> int:
    """Return how many doubles `kinqp_qp_solve` works in, for n variables, p rows of A and m rows of C."""
    _, lib = load()
    return -(-int(lib.kinqp_qp_workspace_size(n, p, m)) // 8)


def _read(names: tuple[str, ...]) -> dict[str, str]:
    folder = files(__package__)
    return {name: folder.joinpath(name).read_text(encoding="utf-8") for name in names}
