from __future__ import annotations

import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.language.load.yaml.compose import MAX_DEPTH, MAX_TEXT, compose
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, SequenceNode, Style, YamlNode, scalars
from codra_dsl.language.load.yaml.scalars import resolve
from codra_dsl.language.load.yaml.source import Source, accept

from .texts import findings_of, loaded, marked, rules_of

ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**30), 10**30) | st.floats(-1e50, 1e50) | st.text(max_size=40),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(min_size=1, max_size=8), inner, max_size=4),
    max_leaves=12,
)


def document(text: str) -> tuple[YamlNode, Source]:
    """Return a document that must give no finding."""
    findings = Findings()
    source = accept(text, "-", findings)
    assert source is not None
    root = compose(source, findings)
    assert findings.all() == ()
    assert root is not None
    return root, source


@pytest.mark.parametrize(
    ("text", "data"),
    [
        ("", None),
        ("~", None),
        ("null", None),
        ("Null", None),
        ("nULL", "nULL"),
        ("true", True),
        ("FALSE", False),
        ("yes", "yes"),
        ("on", "on"),
        ("off", "off"),
        ("n", "n"),
        ("010", 10),
        ("-12", -12),
        ("+12", 12),
        ("0o17", 15),
        ("0x1F", 31),
        ("0b11", "0b11"),
        ("1_000", "1_000"),
        ("1:30", "1:30"),
        ("2024-01-01", "2024-01-01"),
        ("1e3", 1000.0),
        (".5", 0.5),
        ("5.", 5.0),
        ("-1.5E-3", -0.0015),
        (".", "."),
        ("-", "-"),
        ("1.2.3", "1.2.3"),
        ("0.6 rad", "0.6 rad"),
        ("٣", "٣"),
    ],
)
def test_plain_scalars_are_read_by_the_core_schema_of_yaml_1_2(text: str, data: object) -> None:
    value = resolve(text)

    assert (type(value), value) == (type(data), data)


@pytest.mark.parametrize(
    "text", [".inf", "-.Inf", ".nan", "1e101", "-1e999", "9" * 102, "9" * 50_000, "0x" + "f" * 200]
)
def test_a_number_that_no_unit_could_convert_is_refused(text: str) -> None:
    assert rules_of(f"codra: 1\nname: kitchen\ncontext: {{a: {{type: float, range: [{text}, 5]}}}}") == [
        "number-out-of-range"
    ]


def test_a_value_that_is_not_a_number_is_not_reported_as_too_large() -> None:
    findings = findings_of("codra: 1\nname: kitchen\ncontext: {a: {type: float, range: [.NaN, 5]}}")
    assert [finding.message for finding in findings] == ["'.NaN' is not a number"]


@given(ANYTHING, st.booleans() | st.none(), st.sampled_from([None, "'", '"', "|", ">"]), st.integers(10, 100))
def test_dumped_data_is_read_again_with_every_scalar_at_its_place(
    data: object, flow: bool | None, style: str | None, width: int
) -> None:
    import yaml

    text = yaml.safe_dump(
        {"data": data}, default_flow_style=flow, default_style=style, width=width, allow_unicode=True, sort_keys=False
    )
    if "!!" in text or accept(text, "-", Findings()) is None:
        return
    findings = Findings()
    source = accept(text, "-", findings)
    assert source is not None
    root = compose(source, findings)

    assert isinstance(root, MappingNode)
    if style is None and findings.all() == () and "e+" not in text and not is_number_in_yaml_1_2_only(data):
        assert root.data == {"data": data}
    for scalar in scalars(root, lambda _: True):
        assert_place_of_scalar(scalar, source)


def is_number_in_yaml_1_2_only(data: object) -> bool:
    """Return whether data has a text such as `0E0`, which PyYAML writes without quotes: in YAML 1.1 it is a text."""
    import yaml

    if isinstance(data, (list, dict)):
        values = data if isinstance(data, list) else [*data, *data.values()]
        return any(map(is_number_in_yaml_1_2_only, values))
    return isinstance(data, str) and resolve(data) != data and yaml.safe_dump(data).startswith(data)


def assert_place_of_scalar(scalar: ScalarNode, source: Source) -> None:
    import yaml

    written_text = source.text[scalar.start : scalar.end]
    assert marked(source.text, source.span(scalar.start, scalar.end)) == written_text
    if scalar.style is Style.PLAIN:
        assert written_text.split() == scalar.text.split()
    elif scalar.style in (Style.SINGLE_QUOTED, Style.DOUBLE_QUOTED):
        assert [event.value for event in yaml.parse(written_text) if isinstance(event, yaml.ScalarEvent)] == [
            scalar.text
        ]
    else:
        assert written_text.startswith(scalar.style.value)


def test_positions_count_code_points_and_any_line_break() -> None:
    text = "é😀: 😀\r\nb: [x,\r  y]\n"
    root, source = document(text)
    assert isinstance(root, MappingNode)
    sequence = root.value("b")
    assert isinstance(sequence, SequenceNode)

    assert source.span(root.entries["é😀"][1].start, root.entries["é😀"][1].end).column == 5
    assert [source.span(item.start, item.end).line for item in sequence.items] == [2, 3]


def test_the_end_of_a_block_collection_is_the_end_of_its_last_scalar() -> None:
    text = "a:\n  b: c\n\n  # a comment\nd: |\n  e\n\n"
    root, _ = document(text)
    assert isinstance(root, MappingNode)

    assert text[root.entries["a"][1].start : root.entries["a"][1].end] == "b: c"
    assert text[root.entries["d"][1].start : root.entries["d"][1].end] == "|\n  e"


def test_a_second_section_of_the_same_name_is_reported_and_read() -> None:
    spec, findings = loaded("codra: 1\nname: kitchen\nresources:\n  camera: {}\nresources:\n  arm: {}\n  camera: {}\n")

    assert [(finding.rule.name, finding.place.span.line) for finding in findings] == [
        ("duplicate-key", 5),
        ("duplicate-key", 7),
    ]
    assert spec is not None
    assert [resource.name for resource in spec.resources] == ["camera", "arm"]


@pytest.mark.parametrize("opening", ["[", "{a: ", "- ", "? "])
@pytest.mark.parametrize("depth", [MAX_DEPTH + 1, 50_000])
def test_deep_nesting_ends_the_reading(opening: str, depth: int) -> None:
    rules = rules_of("codra: 1\nname: kitchen\ncontext:\n  " + opening * depth)

    assert rules == [*(["key-not-text"] if opening == "? " else []), "nested-too-deeply"]


def test_an_alias_bomb_is_refused_without_being_unfolded() -> None:
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 20)]
    rules = rules_of("codra: 1\nname: kitchen\n" + "\n".join(lines))

    assert rules.count("anchor") == 20
    assert set(rules) == {"anchor", "unknown-key"}


def test_a_list_that_contains_itself_is_refused() -> None:
    assert "anchor" in rules_of("codra: 1\nname: kitchen\nskills: {rest: {preview: &a [*a]}}\n")


def test_a_text_beyond_the_limit_is_refused_and_the_rest_is_read() -> None:
    text = f"codra: 1\nname: kitchen\ncontext: {{a: {{type: bool, label: {'x' * (MAX_TEXT + 1)}}}, b: {{typ: bool}}}}\n"

    assert rules_of(text) == ["text-too-long", "unknown-key"]


def test_only_the_first_of_several_documents_is_read() -> None:
    assert rules_of("codra: 1\nname: kitchen\n---\n[unclosed") == ["second-document"]


def test_a_python_object_is_neither_made_nor_named() -> None:
    findings = findings_of("codra: 1\nname: kitchen\ncontext: !!python/object/apply:os.system [ls]\n")

    assert [finding.rule.name for finding in findings] == ["tag"]


WITHOUT_LIBYAML = """
import sys
sys.modules["yaml._yaml"] = None
from pathlib import Path
import yaml
assert not yaml.__with_libyaml__
from codra_dsl.language.load import load_spec
for name in sys.argv[1:]:
    spec, findings = load_spec(Path(name), Path(name).parent)
    for finding in findings:
        print(name, finding.place.span, finding.code)
"""


def test_without_libyaml_the_findings_and_places_are_the_same() -> None:
    from pathlib import Path

    from codra_dsl.language.load import load_spec

    cases = sorted((Path(__file__).parents[2] / "cases" / "invalid").glob("*.yaml"))
    expected = [
        f"{case} {finding.place.span} {finding.code}" for case in cases for finding in load_spec(case, case.parent)[1]
    ]
    command = [sys.executable, "-c", WITHOUT_LIBYAML, *map(str, cases)]
    completed_process = subprocess.run(
        command, capture_output=True, text=True, check=True, cwd=Path(__file__).parents[3]
    )

    assert completed_process.stdout.splitlines() == expected
