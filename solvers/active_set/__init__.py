"""The library's own active-set solver: portable C that allocates nothing, and its Python backend.

The C is plain C99 and can be used without Python; ``docs/active-set.md`` says how.
"""

from .library import embedded_source, fixed_size_sources, sources
from .solver import STATUSES, ActiveSet

__all__ = ["STATUSES", "ActiveSet", "embedded_source", "fixed_size_sources", "sources"]
