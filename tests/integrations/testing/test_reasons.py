"""The reasons for unknown values in schema.json equal those of the runtime; `--renew-cases` writes them."""

from __future__ import annotations

import copy
import json
import pickle
from pathlib import Path

import codra_dsl
from codra_dsl.runtime import Reason

SCHEMA_FILE = Path(codra_dsl.__file__).parent / "schema.json"


def test_the_schema_lists_the_reasons_of_the_runtime(renew_cases: bool) -> None:
    schema = json.loads(SCHEMA_FILE.read_text("utf-8"))
    reason_schema = schema["$defs"]["belief_object"]["properties"]["unknown"]
    reason_schema["enum"] = ["any", *Reason]
    reason_schema["markdownEnumDescriptions"] = ["any reason", *(reason.meaning for reason in Reason)]
    schema_text = json.dumps(schema, indent=2, ensure_ascii=False) + "\n"

    if renew_cases:
        SCHEMA_FILE.write_text(schema_text, "utf-8")

    assert SCHEMA_FILE.read_text("utf-8") == schema_text


def test_a_reason_equals_its_word() -> None:
    for reason in Reason:
        assert reason == str(reason) == reason.value == json.loads(json.dumps(reason))
        assert Reason(reason.value) is reason
        assert pickle.loads(pickle.dumps(reason)) is copy.deepcopy(reason) is reason


def test_only_failures_of_the_algorithm_count_as_failures() -> None:
    assert [reason for reason in Reason if reason.is_failure] == [Reason.FAILED, Reason.TIMED_OUT, Reason.UNREACHABLE]
