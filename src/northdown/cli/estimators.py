"""``northdown estimators``: what there is, and with which parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from northdown.cli import console
from northdown.cli.parameters import Parameter, describe, summary

if TYPE_CHECKING:
    from northdown.estimators import Estimator


def estimators(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Show the parameters of this one.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Write JSON instead of text.")] = False,
) -> None:
    """List the estimators, or the parameters of one."""
    from northdown.estimators import get, registry

    chosen = list(registry().values()) if name is None else [get(name)]
    if json:
        value = [_as_dict(estimator) for estimator in chosen]
        console.write_json(value if name is None else value[0])
    elif name is None:
        _list(chosen)
    else:
        _show(chosen[0])


def _as_dict(estimator: type[Estimator]) -> dict[str, Any]:
    return {
        "name": estimator.name,
        "class": estimator.__name__,
        "summary": summary(estimator),
        "needs": list(estimator.needs),
        "uses": list(estimator.uses),
        "singular": estimator.singular or None,
        "parameters": [_parameter_as_dict(p) for p in describe(estimator).values()],
    }


def _parameter_as_dict(parameter: Parameter) -> dict[str, Any]:
    return {
        "name": parameter.name,
        "kind": parameter.kind,
        "default": parameter.default,
        "unit": parameter.unit or None,
        "low": parameter.low,
        "high": parameter.high,
        "above": parameter.above,
        "choices": list(parameter.choices) or None,
        "optional": parameter.optional,
        "text": parameter.text,
    }


def _sensors(estimator: type[Estimator]) -> str:
    return " ".join(s if s in estimator.needs else f"({s})" for s in estimator.uses)


def _list(chosen: list[type[Estimator]]) -> None:
    console.table(
        ("estimator", "sensors", "what it is"),
        [(e.name, _sensors(e), summary(e)) for e in chosen],
        left=3,
    )
    print("(sensor): used when there is one. Parameters: northdown estimators NAME")


def _show(estimator: type[Estimator]) -> None:
    console.paragraph(f"{estimator.name}: {summary(estimator)}")
    print(f"Sensors: {_sensors(estimator)}; Python class northdown.{estimator.__name__}")
    if estimator.singular:
        print(f"Fails near: {estimator.singular}")
    parameters = describe(estimator)
    if not parameters:
        print("\nNo parameters.")
    for p in parameters.values():
        print(f"\n-p {p.name}={p.show(p.default)}    ({p.range})")
        console.paragraph(p.text, indent=4)
