"""The marker `kinqp` and the fixture `kinqp_formulation`; nothing heavy is imported before a test asks for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from .trial import Trial

_MARKER = "kinqp(formulation, solver='active-set', robot='lbr_med14', mode='fix-orientation', ticks=200, seed=0)"
_TAKEN = frozenset({"formulation", "solver", "robot", "mode", "ticks", "seed"})


def pytest_configure(config: pytest.Config) -> None:
    """Make the marker known, also to runs with --strict-markers."""
    config.addinivalue_line("markers", f"{_MARKER}: the formulation that the fixture kinqp_formulation runs.")


@pytest.fixture
def kinqp_formulation(request: pytest.FixtureRequest) -> Trial:
    """Run the marked formulation at the same seeded states every time; see `kinqp.testing.trial.Trial`."""
    marker = request.node.get_closest_marker("kinqp")
    if marker is None:
        raise pytest.UsageError("kinqp_formulation: expected the test to be marked, as @pytest.mark.kinqp('my:Mine')")
    given = dict(marker.kwargs)
    if len(marker.args) > 1 or (marker.args and "formulation" in given):
        raise pytest.UsageError(f"kinqp: expected one formulation and all else by name, got {marker.args}, {given}")
    if marker.args:
        given["formulation"] = marker.args[0]
    if unknown := given.keys() - _TAKEN:
        raise pytest.UsageError(f"kinqp: expected {_MARKER}, got {', '.join(sorted(unknown))}")
    if "formulation" not in given:
        raise pytest.UsageError(f"kinqp: expected {_MARKER}, got no formulation")
    from .trial import Trial

    return Trial(**given)
