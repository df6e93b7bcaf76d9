"""`[tool.codra.lint]`: the meaning of settings, and errors in them."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.language.diagnostics import Diagnostic, Place, Severity
from codra_dsl.language.project import project_of
from codra_dsl.workspace.suppression import Settings, known_rules, settings_of
from codra_dsl.workspace.suppression.toml_places import MAX_PARSED_CHARACTERS, TomlPlaces

RULES = known_rules()


def read(tmp_path: Path, text: str | bytes) -> tuple[Settings, tuple[Diagnostic, ...]]:
    (tmp_path / "pyproject.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
    return settings_of(tmp_path)


def lint(text: str) -> str:
    return f"[tool.codra.lint]\n{text}\n"


def code_and_position(finding: Diagnostic) -> tuple[str, int, int, int]:
    span = finding.place.span
    return finding.code, span.line, span.column, span.end_column


def test_without_settings_everything_is_reported_at_the_rule_s_level(tmp_path: Path) -> None:
    settings, findings = settings_of(tmp_path)

    assert findings == ()
    assert all(settings.selects(rule) for rule in RULES.values())
    assert all(settings.level(rule) is rule.severity for rule in RULES.values())
    assert settings.fail_on is Severity.ERROR


def test_settings_are_read(tmp_path: Path) -> None:
    text = lint('select = ["CDR7"]\nignore = ["CDR7102"]\nfail-on = "warning"\nseverity = {CDR7101 = "warning"}')

    settings, findings = read(tmp_path, text)

    assert findings == ()
    assert settings == Settings(
        select=("CDR7",), ignore=("CDR7102",), severity={"CDR7101": Severity.WARNING}, fail_on=Severity.WARNING
    )


@pytest.mark.parametrize(
    ("text", "code", "wanted"),
    [
        ('ignore = ["CDR71"]', "CDR7102", False),
        ('ignore = ["CDR71"]', "CDR7901", True),
        ('select = ["CDR71"]', "CDR3030", False),
        ('select = ["CDR7102"]\nignore = ["CDR71"]', "CDR7102", True),
        ('select = ["CDR71"]\nignore = ["CDR7102"]', "CDR7102", False),
        ('select = ["CDR71"]', "CDR3101", True),
        ('ignore = ["CDR"]', "CDR3101", True),
        ('ignore = ["CDR3024"]', "CDR3024", False),
    ],
)
def test_the_longest_code_decides_and_errors_that_prevent_compiling_are_always_reported(
    tmp_path: Path, text: str, code: str, wanted: bool
) -> None:
    settings, findings = read(tmp_path, lint(text))

    assert findings == ()
    assert settings.selects(RULES[code]) is wanted


def test_severities_go_by_the_longest_code(tmp_path: Path) -> None:
    settings, findings = read(tmp_path, lint('[tool.codra.lint.severity]\nCDR71 = "error"\nCDR7102 = "warning"'))

    assert findings == ()
    assert settings.level(RULES["CDR7101"]) is Severity.ERROR
    assert settings.level(RULES["CDR7102"]) is Severity.WARNING
    assert settings.level(RULES["CDR3101"]) is Severity.ERROR


@pytest.mark.parametrize(
    ("text", "place", "help"),
    [
        ('ignroe = ["CDR7102"]', ("CDR0021", 2, 1, 7), "did you mean 'ignore'?"),
        ('fail_on = "warning"', ("CDR0021", 2, 1, 8), "did you mean 'fail-on'?"),
        ("colour = 1", ("CDR0021", 2, 1, 7), "the known keys are select, ignore, severity, fail-on"),
        ('ignore = ["CDR7102", "CDR7199"]', ("CDR0022", 2, 22, 31), "did you mean 'CDR7109'?"),
        ('ignore = ["unreached-variable"]', ("CDR0022", 2, 11, 31), "did you mean 'CDR7102'?"),
        ('ignore = ["cdr7102"]', ("CDR0022", 2, 11, 20), "did you mean 'CDR7102'?"),
        ('ignore = ["everything"]', ("CDR0022", 2, 11, 23), "a code is CDR and four digits"),
        ('select = "CDR71"', ("CDR0023", 2, 10, 17), 'write select = ["CDR7102"]'),
        ("select = [\n  71,\n]", ("CDR0023", 3, 3, 5), 'write "CDR7102"'),
        ('fail-on = "warn"', ("CDR0023", 2, 11, 17), 'write "error" or "warning"'),
        ('fail-on = "warnin"', ("CDR0023", 2, 11, 19), "did you mean 'warning'?"),
        ("severity = 3", ("CDR0023", 2, 12, 13), 'write severity = {CDR7102 = "error"}'),
        ('severity = {CDR7102 = "info"}', ("CDR0023", 2, 23, 29), 'write "error" or "warning"'),
        ('severity = {CDR7102 = "off"}', ("CDR0023", 2, 23, 28), "to hide findings, use 'ignore'"),
        ('severity = {CDR7199 = "error"}', ("CDR0022", 2, 13, 20), "did you mean 'CDR7109'?"),
        ("ignore = [\"CDR7102\", 'CDR7102']", ("CDR0024", 2, 22, 31), "remove one of them"),
        ('select = ["CDR71"]\nignore = ["CDR71"]', ("CDR0024", 3, 11, 18), "remove one of them"),
        ('ignore = ["CDR3101"]', ("CDR0025", 2, 11, 20), "correct the spec"),
        ('ignore = ["CDR5"]', ("CDR0025", 2, 11, 17), "correct the spec"),
        ('severity = {CDR2003 = "warning"}', ("CDR0025", 2, 13, 20), "correct the spec"),
    ],
)
def test_an_error_is_reported_with_its_place_and_help(
    tmp_path: Path, text: str, place: tuple[str, int, int, int], help: str
) -> None:
    _, (finding,) = read(tmp_path, lint(text))

    assert code_and_position(finding) == place
    assert help in finding.help


def test_a_misspelt_table_is_reported(tmp_path: Path) -> None:
    _, (finding,) = read(tmp_path, "[tool.codra]\n[tool.codra.lnit]\nignore = []\n")

    assert code_and_position(finding)[:2] == ("CDR0021", 2)
    assert finding.help == "did you mean 'lint'?"


@pytest.mark.parametrize("text", ["[tool]\ncodra = 3\n", "[[tool.codra]]\nlint = {}\n", "[tool.codra]\nlint = 1\n"])
def test_a_value_instead_of_a_table_is_reported_and_the_folder_is_still_a_project(tmp_path: Path, text: str) -> None:
    settings, (finding,) = read(tmp_path, text)

    assert settings == Settings()
    assert finding.message.endswith("must be a table")
    assert project_of(tmp_path / "specs") == tmp_path


def test_valid_settings_count_beside_wrong_ones(tmp_path: Path) -> None:
    settings, findings = read(tmp_path, lint('ignore = ["CDR7102", "CDR7", 3]\nselct = 1'))

    assert settings.ignore == ("CDR7102", "CDR7")
    assert len(findings) == 2


@pytest.mark.parametrize(
    ("text", "line", "column"),
    [
        (lint('ignore = ["CDR7102"]\nignore = []'), 3, 12),
        ("[tool.codra.lint\n", 1, 17),
        ("[tool.codra]\nx =", 2, 4),
        (b"[tool.codra]\n# \xff\n", 2, 3),
        (b"\xef\xbb\xbf[tool.codra]\n", 1, 1),
    ],
)
def test_a_file_that_is_not_toml_is_reported_at_the_error(
    tmp_path: Path, text: str | bytes, line: int, column: int
) -> None:
    """A duplicate key makes the file invalid too."""
    _, (finding,) = read(tmp_path, text)

    assert code_and_position(finding)[:3] == ("CDR0020", line, column)
    assert project_of(tmp_path / "specs") == tmp_path


KEYS = st.sampled_from(["select", "ignore", "severity", "fail-on", "other", '"a.b"', "'c d'", "e.f"])
SIMPLE = st.sampled_from(
    ["1", "1.5", "true", '"x"', "'y # no'", '"a \\" b"', "1979-05-27", '"""m\nn"""', "'''\no'''", "inf", "0x1F"]
)
VALUES = st.recursive(
    SIMPLE,
    lambda inner: (
        st.lists(inner, max_size=3).map(lambda items: "[" + ", ".join(items) + "]")
        | st.lists(inner, max_size=3).map(
            lambda items: "[\n  # c\n" + "".join(f"  {item}, # d\n" for item in items) + "]"
        )
        | inner.map(lambda item: "{k = " + item + ", l = 2}")
    ),
    max_leaves=5,
)
ENTRIES = st.dictionaries(KEYS, VALUES, max_size=4)
HEADERS = st.lists(
    st.sampled_from(["[tool.codra.lint]", "[ beside ]", '["q"."r"]', "[[many]]"]), unique=True, max_size=3
)


@given(ENTRIES, HEADERS, ENTRIES)
def test_the_places_of_keys_and_plain_values_of_a_toml_file_are_exact(
    first: dict[str, str], headers: list[str], second: dict[str, str]
) -> None:
    tables = ["", *headers]
    text = "".join(
        header + " # c\n" + "".join(f"{key} = {value}\n" for key, value in (second if header else first).items())
        for header in tables
    ).removeprefix(" # c\n")
    tomllib.loads(text)
    offsets = [0, *(match.end() for match in re.finditer("\n", text))]
    places = TomlPlaces("pyproject.toml", text)

    def at(place: Place) -> str:
        span = place.span
        return text[offsets[span.line - 1] + span.column - 1 : offsets[span.end_line - 1] + span.end_column - 1]

    for table, entries in zip(tables, [first, *[second] * len(headers)], strict=True):
        around = tuple(part.strip(' "') for part in table.strip("[] ").split(".")) if table else ()
        if table == "[[many]]":
            continue
        for key, value in entries.items():
            steps = (*around, *(key[1:-1],)) if key[0] in "\"'" else (*around, *key.split("."))
            assert at(places.key(*steps)) == key.rpartition(".")[2] if key == "e.f" else key
            if value in ("1", "true", '"x"', "'y # no'"):
                assert at(places.value(*steps)) == value


@given(st.dictionaries(st.text("[]{}=,.\"'#ab1", max_size=4), st.integers(), max_size=3))
def test_an_unknown_place_is_the_beginning_of_the_file(entries: dict[str, int]) -> None:
    text = "".join(f"{json.dumps(key)} = {value}\n" for key, value in entries.items())

    assert TomlPlaces("pyproject.toml", text).key("no", "such").span.line == 1
    assert TomlPlaces("pyproject.toml", text).value("no", 1).span.line == 1


@pytest.mark.parametrize(
    ("text", "message", "line"),
    [
        ("[tool.codra]\n[tool.other]\nx = " + "1" * 5000, "a number has too many digits", 3),
        (lint("fail-on = 0x" + "f" * 5000), "'fail-on' cannot be a int", 2),
        ("[tool.codra]\n" + ".".join("a" * 20_000) + " = 1", "more than 100 dots in a line", 2),
        ("[tool.codra]\n" + ".".join(["'='"] * 20_000) + " = 1", "more than 100 dots in a line", 2),
        ('[tool.codra]\nx = "' + '\\"' * 100_000 + '\\\n"', "Unescaped", 3),
        ("[tool.codra]\n#" + "a" * 300_000, "it has more than 256 KiB", 1),
        ("[tool.codra]\nx = " + "[" * 100_000, "it is nested too deeply", 1),
    ],
    ids=["decimal", "hexadecimal", "dots", "quoted dots", "quotes", "size", "brackets"],
)
def test_settings_that_take_too_much_work_are_one_finding(tmp_path: Path, text: str, message: str, line: int) -> None:
    settings, (finding,) = read(tmp_path, text)

    assert settings == Settings()
    assert message in finding.message
    assert finding.place.span.line == line


@pytest.mark.parametrize(
    "text",
    [
        lint("".join(f"key_{number} = 1\n" for number in range(2000))),
        lint("ignore = [" + ", ".join(f'"CDX{number}"' for number in range(2000)) + "]"),
        "[tool.codra.lint.severity]\n" + "".join(f"CDX{number} = 'error'\n" for number in range(2000)),
    ],
    ids=["keys", "codes", "severities"],
)
def test_2000_mistakes_in_settings_are_found_with_a_limited_number_of_searches(
    tmp_path: Path, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Places and suggestions cost most. The first findings have a place; the place of the others is the file."""
    parsed: list[int] = []
    loads = tomllib.loads

    def counting_loads(document: str) -> dict[str, object]:
        parsed.append(len(document))
        return loads(document)

    monkeypatch.setattr(tomllib, "loads", counting_loads)

    _, findings = read(tmp_path, text)

    assert len(findings) == 2000
    assert findings[0].place.span.line == 2
    assert sum(parsed) < MAX_PARSED_CHARACTERS + 3 * (len(text) + 100)
