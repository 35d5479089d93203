"""The tick with CasADi's generated active-set solver in it, to compare with our own: same header, same calls."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import casadi as ca

from ..formulations import DATA, lower
from .render import environment, render_step, step_values

if TYPE_CHECKING:
    from ..formulations import Formulation, Lowered, Mode
    from ..robots import Robot
    from .model import StepCode

NAME: Final = "casadi-qrqp"
# CasADi's own limit is 1000 changes of the active set; what is not solved after 200 is running in circles.
_OPTIONS: Final = {
    "print_iter": False, "print_header": False, "print_info": False, "error_on_fail": False, "max_iter": 200,
    "constr_viol_tol": 1e-9, "dual_inf_tol": 1e-9,
}  # fmt: skip
# The generated solver returns no status: its answer is judged by residuals, relative to their terms.
_TOLERANCE: Final = "1e-7"


def render_qrqp(code: StepCode, formulation: Formulation, robot: Robot, mode: Mode) -> dict[str, str]:
    """Return header and sources of a step in one mode, text by file name.

    Parameters
    ----------
    code : StepCode
        The same step as `step_code` has it; gives structs and names.
    formulation, robot, mode
        What it is made of.
    """
    lowered = lower(formulation, robot, mode)
    tick = _tick(lowered)
    generator = ca.CodeGenerator("qrqp", {"with_header": False, "casadi_int": "int", "main": False})
    generator.add(tick)
    fields = {field.name for field in code.inputs}
    arguments = [
        ("in" if given.name in fields else "p", given.name, _is_array(code, given.name)) if given.size else None
        for given in lowered.inputs
    ]
    # CasADi's solver is not one of ours, but what leaves the tick is looked at all the same.
    values = step_values(replace(code, max_iterations=200)) | {
        "arguments": arguments,
        "sizes": {"arg": tick.sz_arg(), "res": tick.sz_res(), "iw": tick.sz_iw(), "w": tick.sz_w()},
        "tolerance": _TOLERANCE,
        "needs_rows": True,
    }
    text = environment().get_template("qrqp.c.j2").render(values)
    header = f"{code.prefix}.h"
    return {header: render_step(code)[header], f"{code.prefix}.c": text, "qrqp.c": generator.dump()}


def _is_array(code: StepCode, name: str) -> bool:
    return any(field.name == name and (field.array or field.size > 1) for field in (*code.inputs, *code.parameters))


def _tick(lowered: Lowered) -> ca.Function:
    """Inputs to command, Cartesian error, multipliers of the rows, and the largest relative residual."""
    inputs = [ca.MX.sym(given.name, given.size) for given in lowered.inputs]
    data = dict(zip(DATA, lowered.function.call(inputs), strict=True))
    rows = ca.vertcat(data["A"], data["C"])
    structure = {"h": data["H"].sparsity(), "a": rows.sparsity()}
    solver = ca.conic("qrqp", "qrqp", structure, _OPTIONS)
    answer = solver(
        h=data["H"], g=data["g"], a=rows, lba=ca.vertcat(data["b"], data["l"]), uba=ca.vertcat(data["b"], data["u"]),
        lbx=data["lb"], ubx=data["ub"],
    )  # fmt: skip
    residual = _residual(lowered)
    # Calls give tuples of outputs whatever their number.
    worst = residual.call([*(data[name] for name in DATA), answer["x"], answer["lam_a"], answer["lam_x"]])[0]
    qd = data["K"] @ answer["x"] + data["k"]
    task = ca.Function("task", [lowered.tick.q], [ca.densify(lowered.tick.J_free)])
    position = [given.name for given in lowered.inputs].index("q")
    eps = task(inputs[position]) @ qd - inputs[[given.name for given in lowered.inputs].index("v")]
    m_eq = data["b"].size1()
    boxed = [j for j, name in enumerate(lowered.rows.box) if name]
    sides = ca.vertcat(answer["lam_a"][m_eq:], answer["lam_x"][boxed])
    outputs = [ca.densify(value) for value in (qd, eps, sides, worst)]
    return ca.Function("kinqp_qrqp_tick", inputs, outputs)


def _residual(lowered: Lowered) -> ca.Function:
    """Largest violation of a row, of stationarity and of complementarity, each relative to 1 and its terms."""
    shapes = [lowered.function.size_out(name) for name in DATA]
    symbols: dict[str, Any] = {name: ca.SX.sym(name, *shape) for name, shape in zip(DATA, shapes, strict=True)}
    x = ca.SX.sym("x", lowered.n)
    m = shapes[DATA.index("A")][0] + shapes[DATA.index("C")][0]
    lam_a, lam_x = ca.SX.sym("lam_a", m), ca.SX.sym("lam_x", lowered.n)
    A = ca.vertcat(symbols["A"], symbols["C"])
    values = ca.vertcat(A @ x, x)
    lower_, upper = (
        ca.vertcat(symbols["b"], symbols["l"], symbols["lb"]),
        ca.vertcat(symbols["b"], symbols["u"], symbols["ub"]),
    )
    multipliers = ca.vertcat(lam_a, lam_x)
    far = 1e20  # stands for infinity, which times a multiplier of zero is no number
    above, below = ca.fmin(upper - values, far), ca.fmin(values - lower_, far)
    pull = symbols["H"] @ x + symbols["g"] + A.T @ lam_a + lam_x
    size = 1 + ca.norm_inf(symbols["H"] @ x) + ca.norm_inf(symbols["g"]) + ca.norm_inf(multipliers)
    reach = 1 + ca.norm_inf(x)
    parts = [ca.mmax(-above) / reach, ca.mmax(-below) / reach, ca.norm_inf(pull) / size]
    slack = ca.fmax(multipliers, 0) * above + ca.fmax(-multipliers, 0) * below
    parts.append(ca.mmax(ca.fabs(slack)) / (size * reach))
    worst = parts[0]
    for part in parts[1:]:
        worst = ca.fmax(worst, part)
    return ca.Function("residual", [*symbols.values(), x, lam_a, lam_x], [worst])
