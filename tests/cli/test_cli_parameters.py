"""Parameters on the command line, and the docstrings that explain them."""

from __future__ import annotations

import dataclasses
from typing import Any, Literal

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from northdown.cli.parameters import Parameter, describe, parameter_texts, read_assignments
from northdown.errors import InputError
from northdown.estimators import Estimator, get, registry
from northdown.estimators.base import parameter


@dataclasses.dataclass(frozen=True, kw_only=True)
class Everything(Estimator):
    """Has a parameter of each kind.

    More text.

    Parameters
    ----------
    gain : float
        First sentence,
        over two lines.

        Second paragraph with ``code``.
    low, high : float
        Shared text.
    soft : bool
        A switch.
    count : int
        How often.
    way : {"up", "down"}
        Where to.
    limit : float, optional
        How far.

    Returns
    -------
    gain : float
        Not this.
    """

    name = "everything"

    gain: float = parameter(1.5, unit="rad/s", above=0.0)
    low: float = parameter(0.0, low=-1.0, high=1.0)
    high: float = parameter(1.0, low=0.0)
    soft: bool = False
    count: int = parameter(3, low=1)
    way: Literal["up", "down"] = "up"
    limit: float | None = parameter(None, low=0.0, unit="m")

    def _parameters(self, frame: Any) -> Any:
        return ()


def test_numpydoc_section_by_hand():
    texts = parameter_texts(describe.__doc__ or "")
    assert texts == {}
    texts = {name: p.text for name, p in describe(Everything).items()}
    assert texts == {
        "gain": "First sentence, over two lines. Second paragraph with code.",
        "low": "Shared text.",
        "high": "Shared text.",
        "soft": "A switch.",
        "count": "How often.",
        "way": "Where to.",
        "limit": "How far.",
    }


def test_kinds_and_ranges():
    kinds = {name: (p.kind, p.range) for name, p in describe(Everything).items()}
    assert kinds == {
        "gain": ("number", "> 0"),
        "low": ("number", "-1 to 1"),
        "high": ("number", "≥ 0"),
        "soft": ("switch", "true | false"),
        "count": ("whole number", "≥ 1"),
        "way": ("choice", "up | down"),
        "limit": ("number", "≥ 0, or none"),
    }


def test_values_are_read_by_kind():
    values = read_assignments(Everything, ["gain=1e-3", "soft=Yes", "count=7", "way = down", "low=-0.5"])
    assert values == {"gain": 1e-3, "soft": True, "count": 7, "way": "down", "low": -0.5}
    assert isinstance(values["count"], int)
    assert read_assignments(Everything, ["limit=None"]) == {"limit": None}
    assert read_assignments(Everything, ["limit=2"]) == {"limit": 2.0}


def test_values_are_shown_with_their_unit():
    known = describe(Everything)
    shown = {name: p.show(p.default) for name, p in known.items()}
    assert shown == {
        "gain": "1.5 rad/s",
        "low": "0",
        "high": "1",
        "soft": "false",
        "count": "3",
        "way": "up",
        "limit": "none",
    }


@dataclasses.dataclass(frozen=True, kw_only=True)
class Child(Everything):
    """Explains only what it adds or says anew.

    Parameters
    ----------
    gain : float
        Otherwise.
    more : float
        Its own.
    """

    name = "child"

    more: float = parameter(1.0)


def test_inherited_parameters_keep_their_explanation():
    texts = {name: p.text for name, p in describe(Child).items()}
    assert (texts["gain"], texts["more"], texts["soft"]) == ("Otherwise.", "Its own.", "A switch.")


@pytest.mark.parametrize(
    ("assignment", "says"),
    [
        ("gain", "name=value"),
        ("=1", "name=value"),
        ("gain=", "> 0 rad/s"),
        ("gain=fast", "> 0 rad/s"),
        ("soft=maybe", "true | false"),
        ("count=1.5", "≥ 1"),
        ("way=left", "up | down"),
        ("gian=1", "did you mean 'gain'?"),
        ("GAIN=1", "did you mean 'gain'?"),
        ("something=1", "out of gain, low, high"),
    ],
)
def test_mistakes_say_what_is_valid(assignment, says):
    with pytest.raises(InputError) as raised:
        read_assignments(Everything, [assignment])
    assert says in str(raised.value)


def test_no_parameters_and_two_values():
    with pytest.raises(InputError, match="tilt-compass, which has none"):
        read_assignments(get("tilt-compass"), ["x=1"])
    with pytest.raises(InputError, match="gain once"):
        read_assignments(Everything, ["gain=1", "gain=2"])


@pytest.mark.parametrize("name", registry())
def test_every_parameter_of_every_estimator_is_explained_and_its_default_is_accepted(name):
    estimator = get(name)
    found = describe(estimator)
    assert all(p.text.endswith(".") for p in found.values()), [p.name for p in found.values() if not p.text]
    texts = [f"{p.name}={p.default}" for p in found.values()]
    assert estimator(**read_assignments(estimator, texts)) == estimator()


@settings(max_examples=60, deadline=None)
@given(st.text(max_size=20))
def test_whatever_is_typed_gives_a_value_or_one_error(text):
    known = describe(Everything)
    for p in known.values():
        try:
            value = p.read(text)
        except InputError:
            continue
        assert value is None or isinstance(value, (float, int, bool, str))


def test_parameter_is_described_without_unit():
    assert Parameter("x", "number", 1.0).range == "any"
    assert Parameter("x", "number", 1.0, high=2.0).range == "≤ 2"
