"""Any exception and any object has a short text, whatever their methods do."""

from __future__ import annotations

import io
import logging

import pytest

from codra_dsl.isolation.error_text import MAX_TRACEBACK_CHARACTERS, described, loggable, shown
from tests.runtime.hostile_errors import HOSTILE_ERRORS, UNSPEAKABLE, hostile_error


def caught(error: BaseException) -> BaseException:
    """Return an exception with a traceback."""
    try:
        raise error
    except BaseException as raised:  # noqa: BLE001 - any exception is the subject
        return raised


@pytest.mark.parametrize("kind", HOSTILE_ERRORS)
def test_every_exception_is_described_by_its_type_and_the_beginning_of_its_message(kind: str) -> None:
    error, text = hostile_error(kind), HOSTILE_ERRORS[kind]
    assert described(error) == text


@pytest.mark.parametrize("kind", HOSTILE_ERRORS)
def test_every_exception_can_be_logged_with_its_place(kind: str) -> None:
    error, text = hostile_error(kind), HOSTILE_ERRORS[kind]
    stream = io.StringIO()
    logger = logging.Logger("hostile")
    logger.addHandler(logging.StreamHandler(stream))
    logger.error("it failed", exc_info=loggable(caught(error)))
    lines = stream.getvalue().splitlines()
    assert lines[0] == "it failed"
    assert any("test_error_text.py" in line for line in lines)
    assert lines[-1].endswith(text)
    assert len(stream.getvalue()) <= 2 * MAX_TRACEBACK_CHARACTERS


def test_an_exception_without_surprises_is_logged_itself() -> None:
    error = caught(ValueError("no thanks"))
    assert loggable(error) is error


@pytest.mark.parametrize("kind", HOSTILE_ERRORS)
def test_every_object_is_shown(kind: str) -> None:
    error, text_of_error = hostile_error(kind), HOSTILE_ERRORS[kind]
    text = shown(error)
    assert type(text) is str
    assert len(text) <= 203
    assert (text == "an object that cannot be shown") == (UNSPEAKABLE in text_of_error)
