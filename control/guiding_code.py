"""The C of a whole hand-guiding controller, from the wrench to the command."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import casadi as ca

from ..codegen.emit import emit, number
from ..codegen.fields import Field, field_of, mode_symbols
from ..codegen.render import environment, step_values
from .guiding_law import HANDED, GuidingLaw

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..codegen.model import StepCode
    from ..formulations import Input, Mode
    from ..robots import Robot
    from .guiding_settings import GuidingSettings

_COMMENTS: Final = {
    "admittance_mass": "virtual mass and inertia along the mode's axes",
    "admittance_damping": "virtual friction along the mode's axes",
    "force_dead_zone": "force along the guided rows that moves nothing",
    "torque_dead_zone": "torque along the guided rows that moves nothing",
    "drift_gain": "gain of the drift compensation; 0: off",
    "drift_speed": "most that it moves the tool by",
    "drift_turn": "most that it turns the tool by",
    "drift_dead_zone": "distance that it leaves alone",
    "drift_turn_dead_zone": "angle that it leaves alone",
    "stop_deceleration": "what a tool that is brought to rest loses beyond what friction takes",
    "stop_turn_deceleration": "the same of its rotation",
    "observer_gain": "what a measured position counts for; from 1 up: no observer",
    "observer_jump": "a measurement this far from what is expected is believed at once",
    "limit_share": "share of the acceleration limits with which changed velocity limits take effect",
}


@dataclass(frozen=True)
class ModeLaw:
    """What the template needs of one mode.

    Attributes
    ----------
    text, symbol : str
        The mode, and what its C symbols are called by.
    m_fixed : int
        Locked rows.
    law, guided : tuple of str
        Statements.
    """

    text: str
    symbol: str
    m_fixed: int
    law: tuple[str, ...]
    guided: tuple[str, ...]


def render_guiding(
    code: StepCode, robot: Robot, modes: Sequence[Mode], settings: GuidingSettings, dt: float | None = None
) -> dict[str, str]:
    """Write header and source of the controller around a step.

    Parameters
    ----------
    code : StepCode
        The step, in these modes.
    robot : Robot
    modes : sequence of Mode
    settings : GuidingSettings
        Defaults.
    dt : float, optional
        Default of the control period [s]; the step's own without it.

    Returns
    -------
    dict of str to str
        File name to content: ``<prefix>_guiding.h`` and ``<prefix>_guiding.c``, beside the step's own.
    """
    laws = [GuidingLaw(robot, mode, settings) for mode in modes]
    own = {field.name for field in code.parameters}
    # Limits are the step's; what only the law has is a setting.
    fields = {given.name: _setting(given) for given in laws[0].settable if given.name not in own}
    sources = _sources(laws[0].inputs, fields, code)
    values = step_values(code) | {
        "title": f"{code.formulation} on {code.robot}, guided by hand: {', '.join(map(str, modes))}",
        "settings": list(fields.values()),
        "first_setting": len(code.parameters) + 3,
        "max_failures": settings.max_failures,
        "hold_ticks": settings.hold_ticks,
        "dt": None if dt is None else number(dt),
        "previous": any(field.name == "qd_prev" for field in code.inputs),
        "change": "qdd_prev" in own,
        "observe": _statements(laws[0], laws[0].observed, sources | {"q": "q"}),
        "anchor": _statements(laws[0], laws[0].anchor, sources | {"q": "q"}),
        "modes": [
            ModeLaw(
                str(law.mode),
                symbol,
                law.mode.m_fixed,
                _statements(law, law.law, sources | {"q": "q", "wrench": "wrench"}),
                _statements(law, law.guided, sources | {"q": "q", "qd_prev": "qd"}),
            )
            for law, symbol in zip(laws, mode_symbols(modes), strict=True)
        ],
    }
    templates = environment()
    return {
        f"{code.prefix}_guiding.{ending}": templates.get_template(f"guiding.{ending}.j2").render(values)
        for ending in ("h", "c")
    }


def _setting(given: Input) -> Field:
    field = field_of(given)
    return replace(field, comment=f"{_COMMENTS[given.name]} [{given.unit}]")


def _sources(inputs: Sequence[Input], settings: dict[str, Field], code: StepCode) -> dict[str, str]:
    """C expressions of the arrays that the law's inputs are read from, by name."""
    sources = {name: f"state->{name}" for name in HANDED} | {"qd_prev": "state->qd", "stopping": "(&stopping)"}
    of_step = {field.name: field for field in code.parameters}
    for given in inputs:
        if given.name in sources:
            continue
        owner, field = ("p", settings[given.name]) if given.name in settings else ("p->step", of_step[given.name])
        place = f"{owner}{'->' if owner == 'p' else '.'}{given.name}"
        sources[given.name] = place if field.size > 1 or (owner != "p" and field.array) else f"(&{place})"
    return sources


def _statements(law: GuidingLaw, expressions: dict[str, ca.SX], sources: dict[str, str]) -> tuple[str, ...]:
    symbols = law.symbols_of(expressions)
    function = ca.Function("law", list(symbols.values()), [ca.densify(value) for value in expressions.values()])
    tabulated = {f"q[{i}]": f"[{i}]" for i in range(law.robot.nv)}
    return tuple(emit(function, [sources[name] for name in symbols], list(expressions), tabulated))
