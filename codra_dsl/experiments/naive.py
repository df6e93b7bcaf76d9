"""The naive arm: the same perception calls without any idea of when they can be trusted (P1, section 4.1)."""

from __future__ import annotations

from dataclasses import replace

from codra_dsl.model import Algorithm, ObserverSetting, Reference, Spec


def naive(spec: Spec) -> Spec:
    """Return a spec whose observers run without conditions, again as soon as they are done.

    What is called, with what, what it returns and what that means for the variables stays as it is. No skill is left:
    every variable that has an algorithm gets its observer.
    """
    algorithms = tuple(_without_conditions(algorithm) for algorithm in spec.perception)
    return replace(spec, perception=algorithms, skills=(), observers=_without_pause(spec, algorithms))


def _without_conditions(algorithm: Algorithm) -> Algorithm:
    return replace(algorithm, observable_when=(), accept_when=(), min_interval_s=0.0)


def _without_pause(spec: Spec, algorithms: tuple[Algorithm, ...]) -> tuple[ObserverSetting, ...]:
    """Give every tree a period of 0 s and the same priority; its name stays."""
    named = {reference.name for setting in spec.observers for reference in setting.identifies}
    settings = [replace(setting, period_s=0.0, priority=0) for setting in spec.observers]
    for algorithm in sorted(algorithms, key=lambda each: each.rank):  # the first of alternatives names their tree
        variables = tuple(Reference(name=one.variable.name, place=one.variable.place) for one in algorithm.identifies)
        if not named & {reference.name for reference in variables}:
            named |= {reference.name for reference in variables}
            settings.append(
                ObserverSetting(name=algorithm.name, place=algorithm.place, identifies=variables, period_s=0.0)
            )
    return tuple(settings)
