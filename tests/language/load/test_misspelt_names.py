"""Which of two names is misspelt, and the consequences in templates and damaged sections."""

from __future__ import annotations

import pytest

from codra_dsl.language.diagnostics import suggest
from codra_dsl.language.load.schema.misspelt_names import NO_WORDS, Vocabulary, misspelt_declarations

from .texts import findings_of, marked, rules_of, spec_of

TEMPLATE = """\
codra: 1
name: bench
templates:
  jar:
    parameters:
      title: str
      shelf: identifier
      least: {type: int, default: 3}
    context:
      $(instance)_full: {type: bool, label: $(title) on $(shelf)}
    perception:
      look_into_$(instance):
        call: bench.perception:look
        with: {jar: $(instance), shelf: $(shelf)}
        returns: {level: {type: int}}
        accept_when: [level > $(least)]
        identifies: {$(instance)_full: level > 5}
use:
  sugar: {template: jar, title: Sugar, shelf: top}
  salt: {template: jar, title: Salt, shelf: top}
"""


def blamed(uses: dict[str, int], unused: list[str], declared: list[str], words: Vocabulary) -> dict[str, str]:
    return misspelt_declarations(uses, unused, declared, words, suggest)


# The rule


def test_a_name_with_several_uses_is_right() -> None:
    assert blamed({"door": 2}, ["dor"], ["dor", "lamp"], NO_WORDS) == {"door": "dor"}


def test_if_both_names_occur_once_the_use_is_considered_misspelt() -> None:
    assert blamed({"door": 1}, ["dor"], ["dor", "lamp"], NO_WORDS) == {}


def test_if_both_names_occur_once_the_one_with_known_words_is_right() -> None:
    words = Vocabulary(["dor_open", "door_near", "look_at_door"])

    assert blamed({"door_open": 1}, ["dor_open"], ["dor_open", "door_near"], words) == {"door_open": "dor_open"}
    assert blamed({"dor_open": 1}, ["door_open"], ["door_open", "door_near"], words) == {}


def test_a_name_that_is_nearer_to_a_used_one_is_a_misspelling_of_that() -> None:
    assert blamed({"door_opn": 3}, ["door_op_left"], ["door_open", "door_op_left"], NO_WORDS) == {}


def test_a_name_without_its_last_words_is_near() -> None:
    assert blamed({"pcr_cycler_in_view": 2}, ["pcr_cycler"], ["pcr_cycler", "lamp"], NO_WORDS) == {
        "pcr_cycler_in_view": "pcr_cycler"
    }


def test_one_declaration_is_blamed_for_one_name() -> None:
    assert len(blamed({"door": 2, "doors": 2}, ["dor"], ["dor"], NO_WORDS)) == 1


# Templates


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("title: str", "titel: str"),
        ("shelf: identifier", "shef: identifier"),
        ("  jar:", "  jarr:"),
    ],
)
def test_a_misspelt_declaration_is_one_finding_with_its_uses(old: str, new: str) -> None:
    text = TEMPLATE.replace(old, new, 1)
    (finding,) = findings_of(text)
    name = old.strip().partition(":")[0]

    assert finding.help == f"did you mean '{name}'?"
    assert marked(text, finding.place) == new.strip().partition(":")[0]
    assert len(finding.related) >= 1


@pytest.mark.parametrize("old", ["label: $(title)", "shelf: $(shelf)", "level > $(least)"])
def test_a_misspelt_parameter_is_reported_at_its_place(old: str) -> None:
    text = TEMPLATE.replace(old, old.replace(")", "t)"))
    (finding,) = findings_of(text)

    assert finding.rule.name == "unknown-parameter"
    assert marked(text, finding.place) == old.partition("$")[2].join(("$", "")).replace(")", "t)")


def test_an_unknown_parameter_is_one_finding_for_all_its_places() -> None:
    text = TEMPLATE.replace("$(title) on", "$(colour) on").replace("jar: $(instance),", "jar: $(colour),")
    (finding,) = findings_of(text)

    assert [marked(text, place) for place in (finding.place, *(other.place for other in finding.related))] == [
        "$(colour)"
    ] * 2


@pytest.mark.parametrize(
    ("old", "new", "help_text"),
    [
        ("      $(instance)_full: {", "      $(instance_full: {", "write $(instance)"),
        ("      $(instance)_full: {", "      instance)_full: {", "write $(instance)"),
        ("      $(instance)_full: {", "      $instance)_full: {", "write $(instance)"),
        ("      $(instance)_full: {", "      (instance)_full: {", "write $(instance)"),
        ("      $(instance)_full: {", "      $( instance )_full: {", "write $(instance)"),
        ("jar: $(instance)", "jar: instance)", "write $(instance)"),
        ("level > $(least)", "level > $(least", "write $(least)"),
        ("level > $(least)", "level > least)", "write $(least)"),
        ("label: $(title) on", "label: title) on", "write $(title)"),
    ],
)
def test_a_parameter_with_wrong_punctuation_is_one_finding(old: str, new: str, help_text: str) -> None:
    assert TEMPLATE.count(old) == 1
    (finding,) = findings_of(TEMPLATE.replace(old, new))

    assert finding.rule.name == "ill-formed-parameter"
    assert finding.help == help_text


def test_parentheses_in_prose_and_conditions_are_not_parameters() -> None:
    text = TEMPLATE.replace("$(title) on", "(title) $(title) on").replace("level > $(least)", "(level) > $(least)")

    assert findings_of(text) == ()


def test_a_variable_of_a_shell_is_not_a_parameter_and_stays_as_it_is() -> None:
    text = TEMPLATE.replace("label: $(title) on", "label: $HOME/x $(title) on")

    assert findings_of(text) == ()
    assert any((variable.label or "").startswith("$HOME/x ") for variable in spec_of(text).context)


# Lost sections


@pytest.mark.parametrize("into", ["true", "17", "tmplts", "[]", ""])
@pytest.mark.parametrize("key", ["templates", "use", "    parameters", "    context", "    perception"])
def test_a_section_with_a_damaged_key_gives_no_other_findings(key: str, into: str) -> None:
    blanks = key[: len(key) - len(key.lstrip())]
    text = TEMPLATE.replace(f"\n{key}:", f"\n{blanks}{into}:")
    assert text != TEMPLATE

    assert len(findings_of(text)) == 1


def test_a_misspelt_section_is_read_as_intended() -> None:
    text = TEMPLATE.replace("templates:", "template:").replace("type: int, default", "type: in, default")

    assert rules_of(text) == ["unknown-key", "unknown-value"]


def test_the_only_unknown_key_is_taken_for_the_missing_one() -> None:
    text = "codra: 1\nname: a\ncontext:\n  near: {kind: bool, source: main_execution}\n"
    (finding,) = findings_of(text)

    assert marked(text, finding.place) == "kind"
    assert finding.help == "did you mean 'type', which is missing?"


def test_the_only_unknown_argument_is_taken_for_the_missing_one() -> None:
    (finding,) = findings_of(TEMPLATE.replace("title: Sugar", "label: Sugar"))

    assert finding.help == "did you mean 'title', which is missing?"


@pytest.mark.parametrize("key", ["coodra", "bodra", "true", "version"])
def test_a_misspelt_codra_key_is_the_only_finding(key: str) -> None:
    assert rules_of(f"{key}: 1\nname: kitchen\n") == ["unknown-key"]
