"""``northdown estimators``."""

from __future__ import annotations

import dataclasses
import json

from northdown.estimators import registry


def test_list(run):
    result = run("estimators")
    assert (result.code, result.err) == (0, "")
    assert all(name in result.out for name in registry())
    assert "gyr acc (mag)" in result.out


def test_json_is_complete(run):
    value = json.loads(run("estimators", "--json").out)
    assert [e["name"] for e in value] == list(registry())
    for entry in value:
        estimator = registry()[entry["name"]]
        assert entry["needs"] == list(estimator.needs)
        assert entry["class"] == estimator.__name__
        names = [f.name for f in dataclasses.fields(estimator)]
        # the geometry of an array is not written as a number
        assert [p["name"] for p in entry["parameters"]] == [name for name in names if name != "array"]
        assert entry["summary"].endswith(".")


def test_one(run):
    result = run("estimators", "mahony")
    assert result.code == 0
    assert "-p kp=0.74 rad/s    (≥ 0)" in result.out
    assert "-p integrator=first-order    (first-order | rk4 | closed-form)" in result.out
    assert "1/kp is the time constant" in " ".join(result.out.split())
    assert max(map(len, result.out.splitlines())) <= 80
    value = json.loads(run("estimators", "mahony", "--json").out)
    assert value["parameters"][0]["default"] == 0.74
    assert value["parameters"][0]["high"] is None


def test_one_without_parameters(run):
    assert "No parameters." in run("estimators", "tilt-compass").out
