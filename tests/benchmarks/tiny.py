"""A scenario of a few ticks, for tests of the machinery around it."""

from dataclasses import replace

from kinqp.benchmarks import Scenario, get_scenario


def tiny() -> Scenario:
    scenario = get_scenario("semicircle")
    return replace(scenario, name="tiny", phases=(replace(scenario.only_phase, duration=0.02),))
