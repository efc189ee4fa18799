"""Texts that no encoder accepts, such as the name of a file that is not UTF-8."""

from __future__ import annotations

import os

import msgspec
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from autodrive.base.texts import encodable, total
from autodrive.protocol.codec import encode
from autodrive.protocol.messages import Drawing
from autodrive.protocol.native import Drawn, Error
from autodrive.protocol.own_files import OwnFile
from autodrive.recording.wire import WireMessage
from tests.support.native_clients import unpack


@given(st.binary())
def test_the_name_of_a_file_has_the_escapes_of_python(name: bytes) -> None:
    assert encodable(os.fsdecode(name)) == name.decode("utf-8", "backslashreplace")


@given(st.text(st.characters(categories=["Cs", "L"])))
def test_every_text_can_be_encoded_and_a_valid_one_stays(text: str) -> None:
    encodable(text).encode()
    if not any("\ud800" <= character <= "\udfff" for character in text):
        assert encodable(text) == text


def test_every_text_of_a_message_is_escaped() -> None:
    name = "stra\udcdfe\ud800"
    escaped = "stra\\xdfe\\ud800"
    assert unpack(encode(Error("request", name, 3))) == {"type": "Error", "code": "request", "text": escaped, "id": 3}
    drawn = Drawn(name, Drawing("text", np.array([[1.5, 2.0, 3.0]]), text=name), 0.5)  # type: ignore[arg-type]
    found = unpack(encode(drawn))
    assert (found["name"], found["drawing"]["text"]) == (escaped, escaped)
    to_json = total(msgspec.json.encode)
    assert msgspec.json.decode(to_json({name: [OwnFile("map", name), (1.0, name)]})) == {
        escaped: [{"kind": "map", "title": escaped}, [1.0, escaped]]
    }
    message = WireMessage(OwnFile)
    assert message.decode(message.encode(OwnFile("map", name))) == {"kind": "map", "title": escaped}
