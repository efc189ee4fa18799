"""YAML in, checked Spec out: every fault of a file is told at once, with its place."""

import contextlib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import Field

from autodrive.descriptions import Kind, Spec, find, names, parse, read
from autodrive.errors import SpecError
from autodrive.maps.map import MapSpec
from autodrive.maps.module import ModuleSpec
from autodrive.scenario import ScenarioSpec
from autodrive.vehicles.spec import VehicleSpec

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


def faults(text: str) -> list[str]:
    with pytest.raises(SpecError) as caught:
        parse(text, Street, where="street.yaml")
    assert str(caught.value).endswith("(street.yaml)")
    return caught.value.faults


@pytest.mark.parametrize("kind", SPECS)
def test_every_description_that_comes_with_the_simulator_is_in_order(kind: Kind) -> None:
    assert names(kind)
    for name in names(kind):
        assert isinstance(read(kind, name, SPECS[kind]), SPECS[kind])


def test_unknown_name_is_told_with_the_known_ones_and_the_nearest() -> None:
    with pytest.raises(SpecError, match=r"map 'tiny_twon' is not known\. Known: .*Did you mean 'tiny_town'\?"):
        find("map", "tiny_twon")


def test_missing_file_is_told_with_its_path(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"there is no file '.*nowhere\.yaml'"):
        read("map", tmp_path / "nowhere.yaml", MapSpec)


def test_all_faults_are_told_at_once_with_place_and_line() -> None:
    told = faults("nmae: High Street\nlamps:\n  - power: 3\n  - power: -1\n    colour: red\n")
    assert len(told) == 4
    assert any(fault.startswith("name: is missing") for fault in told)
    assert any("nmae (line 1): 'nmae' is not known here" in fault and "Did you mean 'name'?" in fault for fault in told)
    assert any(fault.startswith("lamp 2.power (line 4)") and "-1" in fault for fault in told)
    assert any("lamp 2.colour (line 5)" in fault and "Did you mean 'color'?" in fault for fault in told)


def test_key_that_stands_twice_is_a_fault() -> None:
    assert faults("name: a\nname: b\n") == ["name (line 2): stands twice, first in line 1"]


def test_wrong_type_is_told_with_the_value() -> None:
    (told,) = faults("name: a\nlamps: [{power: bright}]\n")
    assert told.startswith("lamp 1.power (line 2)")
    assert "'bright'" in told


@pytest.mark.parametrize("number", [".inf", "-.inf", ".nan"])
def test_number_that_is_not_finite_is_refused(number: str) -> None:
    assert "finite" in faults(f"name: a\nlamps: [{{power: {number}}}]\n")[0]


@pytest.mark.parametrize(("text", "told"), [("", "NoneType"), ("- a\n- b\n", "list"), ("just words", "str")])
def test_file_that_holds_no_keys_is_told_what_would_be_right(text: str, told: str) -> None:
    assert faults(text) == [f"a Street is a list of 'key: value' lines, not {told}"]


def test_text_that_is_not_yaml_is_told_with_its_line() -> None:
    (told,) = faults("name: [a\nlamps: }\n")
    assert told.startswith("not YAML")
    assert "line 2" in told


@given(st.text(max_size=80))
def test_any_text_is_read_or_refused_with_a_clear_error(text: str) -> None:
    with contextlib.suppress(SpecError):  # anything else would be a crash
        parse(text, Street)
