"""A process that runs trials: names of trials in, rows out, one line each.

``python -m kinqp.benchmarks.study.worker FOLDER`` reads the study's plan from the folder and trials from its standard
input; a row is written whole to `trials/NAME.json`, then its name to the standard output.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from ..store import write_whole
from .plan import Course, Trial
from .result import StudySettings


def main() -> None:
    """Run what is asked for until there is no more."""
    folder = Path(sys.argv[1])
    settings = StudySettings.from_json(json.loads((folder / "plan.json").read_text(encoding="utf-8")))
    course = Course.of(settings)
    for line in sys.stdin:
        name = line.strip()
        row = course.row(Trial.parse(name))
        write_whole(folder / "trials" / f"{name}.json", (json.dumps(row) + "\n").encode())
        sys.stdout.write(name + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
