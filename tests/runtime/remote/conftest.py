"""All messages that the tests of this folder exchange are compared with the published schema."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from codra_dsl.runtime.remote import connection, session
from codra_dsl.runtime.remote.agents import agent_session
from codra_dsl.runtime.remote.protocol import MessageError, Request, answer_to, error_to, notice, request_of
from tests.runtime.remote.published_schema import is_valid


@pytest.fixture(autouse=True, scope="module")
def _messages_follow_the_published_schema() -> Iterator[None]:
    """Requests are valid exactly if the manager accepts their shape; what the manager sends is always valid."""
    deviations: list[object] = []

    def checked_request(message: object) -> Request:
        try:
            request = request_of(message)
        except MessageError:
            deviations.extend([("accepted by the schema only", message)] * is_valid("request", message))
            raise
        deviations.extend([("refused by the schema", message)] * (not is_valid("request", message)))
        return request

    def checked(definition: str, create: Callable[..., Any]) -> Callable[..., Any]:
        def create_checked(*arguments: Any, **fields: Any) -> Any:
            message = create(*arguments, **fields)
            deviations.extend([message] * (not is_valid(definition, message)))
            return message

        return create_checked

    def checked_answer(self: session.Session, request: Request) -> Any:
        answer = handle_request(self, request)
        if answer is not None and not is_valid(f"answer.{request.ask}", answer):
            deviations.append((request.ask, answer))
        return answer

    handle_request = session.Session._handle_request
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(session.Session, "_handle_request", checked_answer)
        patch.setattr(session, "request_of", checked_request)
        for module in (session, connection):
            patch.setattr(module, "error_to", checked("error", error_to))
        for module in (session, connection, agent_session):
            patch.setattr(module, "notice", checked("notice", notice))
        patch.setattr(session, "answer_to", checked("answer", answer_to))
        yield
    assert deviations == []
