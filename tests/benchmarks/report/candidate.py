"""A solver that changes from one sweep to the next under the same name, as one does that is being worked on."""

from __future__ import annotations

import os
import time
from typing import TYPE_CHECKING

from tests.benchmarks.tiny import Delegating

if TYPE_CHECKING:
    import numpy as np

#: Environment variable that says how it behaves: "", "slow" or "wrong"; worker processes inherit it.
BEHAVIOUR = "KINQP_TEST_CANDIDATE"


class Candidate(Delegating):
    """Solves as the active set does; takes its time or answers wrongly where that is asked for."""

    def before(self, call: int) -> None:  # noqa: ARG002  # as of the class above
        if os.environ.get(BEHAVIOUR) == "slow":
            time.sleep(1e-3)

    def after(self, x: np.ndarray, call: int) -> np.ndarray:
        wrong = os.environ.get(BEHAVIOUR) == "wrong" and call % 3 == 0
        return x + 1e-3 if wrong else x
