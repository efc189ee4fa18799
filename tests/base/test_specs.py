"""Reading of YAML files into Specs: all errors of a file are reported at once, each with its location."""

import contextlib
import pickle
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import Field

from autodrive.base.errors import SpecError
from autodrive.base.specs import Spec
from autodrive.base.yaml_files import parse
from autodrive.scenario import ScenarioSpec
from autodrive.scenario.kinds import Kind, find, names, read
from autodrive.scenario.maps.map import MapSpec
from autodrive.scenario.maps.module import ModuleSpec
from autodrive.scenario.vehicles.spec import VehicleSpec

SPECS: dict[Kind, type[Spec]] = {
    "vehicle": VehicleSpec,
    "module": ModuleSpec,
    "map": MapSpec,
    "scenario": ScenarioSpec,
}


class Lamp(Spec):
    power: float = Field(gt=0)
    color: str = "white"


class Street(Spec):
    name: str
    lamps: tuple[Lamp, ...] = ()


def errors_in(text: str) -> list[str]:
    with pytest.raises(SpecError) as caught:
        parse(text, Street, where="street.yaml")
    assert str(caught.value).endswith("(street.yaml)")
    return caught.value.errors


@pytest.mark.parametrize("kind", SPECS)
def test_all_included_files_are_valid(kind: Kind) -> None:
    assert names(kind)
    for name in names(kind):
        assert isinstance(read(kind, name, SPECS[kind]), SPECS[kind])


def test_an_unknown_name_is_reported_with_the_known_names_and_the_closest_one() -> None:
    with pytest.raises(SpecError, match=r"map 'tiny_twon' is not known\. Known: .*Did you mean 'tiny_town'\?"):
        find("map", "tiny_twon")


def test_a_missing_file_is_reported_with_its_path(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"file '.*nowhere\.yaml' does not exist"):
        read("map", tmp_path / "nowhere.yaml", MapSpec)


def test_all_errors_are_reported_with_location_and_line() -> None:
    errors = errors_in("nmae: High Street\nlamps:\n  - power: 3\n  - power: -1\n    colour: red\n")
    assert len(errors) == 4
    assert any(error.startswith("name: is required") for error in errors)
    assert any("nmae (line 1): 'nmae' is not a known key" in e and "Did you mean 'name'?" in e for e in errors)
    assert any(error.startswith("lamp 2.power (line 4)") and "-1" in error for error in errors)
    assert any("lamp 2.colour (line 5)" in error and "Did you mean 'color'?" in error for error in errors)


def test_a_duplicate_key_is_an_error() -> None:
    assert errors_in("name: a\nname: b\n") == ["name (line 2): duplicate key, first defined in line 1"]


def test_a_wrong_type_is_reported_with_the_value() -> None:
    (error,) = errors_in("name: a\nlamps: [{power: bright}]\n")
    assert error.startswith("lamp 1.power (line 2)")
    assert "'bright'" in error


@pytest.mark.parametrize(("text", "found"), [("", "nothing"), ("- a\n- b\n", "a list"), ("just words", "a value")])
def test_a_file_without_keys_is_refused_with_what_is_expected(text: str, found: str) -> None:
    assert errors_in(text) == [f"line 1: expected 'key: value' lines (Street), found {found}"]


def test_invalid_yaml_is_reported_with_its_line() -> None:
    (error,) = errors_in("name: [a\nlamps: }\n")
    assert error.startswith("invalid YAML")
    assert "line 2" in error


@pytest.mark.parametrize(
    ("word", "key"),
    [("yaw", "yaw_deg"), ("heading", "yaw_deg"), ("position", "x"), ("noise", "has_realistic_sensors")],
)
def test_a_wrong_key_is_suggested_by_its_meaning(word: str, key: str) -> None:
    with pytest.raises(SpecError, match=rf"'{word}' is not a known key\..* Did you mean '{key}'\?"):
        parse(f"vehicles: {{V1: {{{word}: 1}}}}", ScenarioSpec)


def test_a_wrong_key_of_a_shape_is_compared_with_the_keys_of_that_shape() -> None:
    with pytest.raises(SpecError, match=r"Known: end_deg, inner_radius, outer_radius, shape, start_deg, x, y\."):
        parse("title: a\npaved: [{shape: sector, radius: 3, start_deg: 0, end_deg: 9}]", MapSpec)


WRONG = [None, "text", -1, 1.5, 1e9, True, [], {}, [1], [1, 2, 3, 4, 5, 6], {"a": 1}, {1: 2}, {"shape": "blob"}]
"""Values that are wrong for most keys."""


def with_wrong_values(tree: Any) -> Iterator[Any]:
    """The tree with one wrong value, one missing key or one unknown key."""
    if isinstance(tree, dict):
        for key, value in tree.items():
            yield from ({**tree, key: wrong} for wrong in (*WRONG, *with_wrong_values(value)))
            yield {other: value for other, value in tree.items() if other != key}
        yield {**tree, "no_such_key": 1}
    elif isinstance(tree, list):
        for i, value in enumerate(tree[:2]):
            yield from ([*tree[:i], wrong, *tree[i + 1 :]] for wrong in (*WRONG, *with_wrong_values(value)))


@pytest.mark.parametrize(
    ("kind", "name"),
    [("scenario", "boxes"), ("map", "mini_map"), ("module", "three_way_intersection"), ("vehicle", "nigel")],
)
def test_no_error_has_the_words_of_pydantic(kind: Kind, name: str) -> None:
    words = r"Input|valid |dictionary|tuple|parse|instance of|Field|Spec\b|validation|Value error|[Ee]xtra"
    pydantic = re.compile(words)
    texts: list[str] = []
    for tree in with_wrong_values(yaml.safe_load(find(kind, name).read_text())):
        try:
            SPECS[kind](**{str(key): value for key, value in tree.items()})
        except SpecError as error:
            texts += error.errors
    assert len(texts) > 100
    assert [text for text in texts if pydantic.search(text)] == []


@given(st.text(max_size=80))
@settings(max_examples=50)
def test_any_text_is_parsed_or_refused_with_a_spec_error(text: str) -> None:
    with contextlib.suppress(SpecError):  # any other exception fails the test
        parse(text, Street)


def test_an_error_of_a_file_can_be_sent_to_another_process() -> None:
    """By pickle, and by Gymnasium, which makes a new error of the one that another process has raised."""
    error = SpecError(["speed: must be positive", "mass: must be positive"], "car.yaml")
    copy = pickle.loads(pickle.dumps(error))
    assert (str(copy), copy.errors, copy.path) == (str(error), error.errors, "car.yaml")
    again: Any = SpecError(copy)
    assert str(again) == str(error)
