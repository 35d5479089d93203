"""The loop that the exported README shows, built and run as it stands there."""

from __future__ import annotations

import re
import subprocess
from typing import TYPE_CHECKING

import numpy as np

from kinqp.codegen import export_c
from kinqp.solvers.native import compiler
from tests.codegen.test_export import STRICT
from tests.robots.chains import chain

if TYPE_CHECKING:
    from pathlib import Path

NV, TICKS, LOST = 3, 160, 100
# Around the README's own lines: an arm that follows its commands, and a hand that pulls, is lost until the arm is at
# rest (NaN, which ends in the safe stop), and asks for nothing from the next tick on.
PROGRAM = """
#include <math.h>
#include <stdio.h>
{header}
int main(void) {{
    double q[{nv}] = {{0.3, 0.1, 0.2}};
    int rest = 0;
{setup}
    for (int tick = 0; tick < {ticks}; ++tick) {{
{body}
        double fastest = 0.0;
        for (int i = 0; i < {nv}; ++i) {{
            q[i] += parameters.dt * output.qd[i];
            fastest = fmax(fastest, fabs(output.qd[i]));
            printf("%.17g ", output.qd[i]);
        }}
        printf("%d\\n", (int)output.stop);
        if (tick >= {lost} && fastest == 0.0) rest = 1;
    }}
    return 0;
}}
"""
SENSED = """
        for (int i = 0; i < {nv}; ++i) input.q[i] = q[i];
        input.v[0] = tick < {lost} ? 0.1 : rest ? 0.0 : NAN;
        input.v[1] = 0.5 * input.v[0];
"""


def test_the_loop_of_the_readme_comes_to_rest_and_stays_there(tmp_path: Path) -> None:
    export_c(chain(NV), "joint-space-robust", ["position"], tmp_path, name="arm")
    readme = (tmp_path / "README.md").read_text(encoding="utf-8")
    loop = re.search(r"## At 1 kHz\n\n```c\n(.*?)```", readme, flags=re.DOTALL)
    assert loop is not None
    setup, _, body = loop[1].partition("/* every millisecond: */\n")
    header, _, setup = setup.partition("\n\n")
    body, sensed = re.subn(r"/\* input\.mode, .*? \*/", SENSED.format(nv=NV, lost=LOST), body)
    assert sensed == 1
    program = PROGRAM.format(header=header, setup=setup, body=body, nv=NV, ticks=TICKS, lost=LOST)
    (tmp_path / "loop.c").write_text(program, encoding="utf-8")
    line = [*compiler(), *STRICT, "loop.c", "arm.c", "-o", "loop", "-lm"]
    built = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr[:2000]
    ran = subprocess.run(["./loop"], cwd=tmp_path, capture_output=True, text=True, check=True)
    told = np.array([[float(x) for x in row.split()] for row in ran.stdout.splitlines()])
    qd, stop = told[:, :NV], told[:, NV] != 0.0
    assert np.abs(qd[LOST - 1]).max() > 0.1
    rest = LOST + int(np.argmin(np.any(qd[LOST:] != 0.0, axis=1)))
    assert stop.tolist() == [LOST <= tick <= rest for tick in range(TICKS)]
    # The last of the braking leaves an acceleration of several rad/s^2: handed on, the arm would go back.
    assert np.abs(qd[rest - 1]).max() > 1e-3
    assert np.abs(qd[rest:]).max() < 1e-12
