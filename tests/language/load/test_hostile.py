"""Loading of any input ends without an exception, and findings have places in the text."""

from __future__ import annotations

import gc
import sys
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.language.load import load_text

from .texts import loaded, rules_of

ROOT = Path(__file__).parents[3]
LAB = (ROOT / "specs" / "lab.yaml").read_text("utf-8")
MACHINE = (ROOT / "specs" / "parts" / "machine.yaml").read_text("utf-8")
LAB_IN_ONE_FILE = LAB.replace("include: [parts/machine.yaml]\n", "") + MACHINE.replace("codra: 1\n", "")
SNIPPETS = [
    *(
        "!",
        "&a ",
        "*a",
        "<<: ",
        "> ",
        "| ",
        "- ",
        "? ",
        ": ",
        ", ",
        " # ",
        "'",
        '"',
        "{",
        "}",
        "[",
        "]",
        "\t",
        "\r",
        "\n",
    ),
    *("$(", "$(title)", "$(instance)", "$()", "true", "null", "~", "1e999", "-", ".", "%YAML 1.2\n", "---\n", "...\n"),
    *(
        "\\",
        "\x00",
        "\x85",
        "\ufeff",
        "\u2028",
        "é",
        "😀",
        "class",
        "codra: 2",
        "context:",
        "name: x\n",
        "enter",
        "@",
        "`",
    ),
]


def assert_in_text(findings: tuple[Diagnostic, ...], text: str) -> None:
    lines = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n").split("\n")
    for finding in findings:
        for place in (finding.place, *(related.place for related in finding.related)):
            span = place.span
            assert 1 <= span.line <= span.end_line <= len(lines)
            assert 1 <= span.column <= len(lines[span.line - 1]) + 2
            assert (span.line, span.column) <= (span.end_line, span.end_column)
        assert finding.message
        assert finding.message.isprintable()
        assert finding.help.isprintable()


@given(st.binary(max_size=300))
@example(b"\xff\xfe\x00\x00")
@example(b"codra: 1\nname: \xc3\x28\n")
def test_any_bytes_can_be_loaded(data: bytes) -> None:
    _, findings = loaded(data)

    assert findings


@given(st.text(max_size=300))
@example("codra: 1\nname: \ud800\n")
@example("codra: 1\nname: \x00\n")
@example("? ? ?")
@example("{codra: 1, name: a, ? {b: c} : d}")
def test_any_text_can_be_loaded(text: str) -> None:
    _, findings = loaded(text)

    assert_in_text(findings, text)


@pytest.mark.parametrize(
    "written",
    ["|{}", ">{}", "'a'{}", "a: {}", "[a > {}, 3]", "!{} a", "{} ? a : b", "{} # or x", "-{}:"],
)
def test_a_character_that_cannot_be_printed_is_escaped_in_findings(written: str) -> None:
    value = written.format("\ud7fc")
    text = (
        "codra: 1\nname: kitchen\nperception:\n  look:\n    call: a:b\n    returns: {x: {type: float}}\n"
        f"    identifies: {value}\n    observable_when: {value}\n"
    )
    findings = loaded(text)[1]

    assert any("\\xd7fc" in finding.message + finding.help for finding in findings)
    assert_in_text(findings, text)


@given(st.text(st.sampled_from("abx$()[]{}:,-#'\"!&*>|? \n01"), max_size=120))
def test_any_text_in_place_of_conditions_can_be_loaded(text: str) -> None:
    inner = text.replace("\n", "\n        ")
    spec = (
        "codra: 1\nname: kitchen\nperception:\n  look:\n    call: a:b\n    returns: {x: {type: float}}\n"
        f"    identifies: {inner}\n    observable_when: {inner}\n"
    )

    assert_in_text(loaded(spec)[1], spec)


@settings(max_examples=75)
@given(st.integers(0, len(LAB_IN_ONE_FILE)), st.integers(0, 12), st.lists(st.sampled_from(SNIPPETS), max_size=3))
def test_a_spec_with_any_change_can_be_loaded(at: int, length: int, inserted: list[str]) -> None:
    text = LAB_IN_ONE_FILE[:at] + "".join(inserted) + LAB_IN_ONE_FILE[at + length :]
    spec, findings = load_text(text, "lab.yaml", ROOT)

    assert_in_text(findings, text)
    assert spec is not None or findings


@pytest.mark.parametrize("removed", ["type", "call", "returns", "identifies", "template", "title", "codra", "name"])
def test_a_removed_key_is_reported(removed: str) -> None:
    lines = LAB_IN_ONE_FILE.split("\n")
    first = next(index for index, line in enumerate(lines) if f"{removed}: " in line or f"{removed}:" in line)
    changed = "\n".join([*lines[:first], lines[first].replace(f"{removed}:", f"{removed}x:", 1), *lines[first + 1 :]])

    assert loaded(changed)[1]


@pytest.mark.parametrize(
    "text",
    [
        "codra: 1\nname: kitchen\ncontext: {a: {type: bool, label: " + "x" * 10_000_000 + "}}",
        "codra: 1\nname: kitchen\n" + "a: 1\n" * 100_000,
        "codra: 1\nname: kitchen\n" + "".join(f"a{n}: 1\n" for n in range(20_000)),
        "codra: 1\nname: kitchen\ncontext: {" + "a, " * 100_000 + "}",
        "codra: 1\nname: kitchen\nskills: {a: {preview: [" + "min(, " * 50_000 + "]}}",
        "codra: 1\nname: kitchen\nperception: {a: {observable_when: [" + "min(a, " * 20_000 + "]}}",
        "codra: 1\nname: kitchen\nperception: {a: {identifies: {" + "a: min(b, " * 20_000 + "}}}",
        "codra: 1\nname: kitchen\nperception: {a: {observable_when: [" + "'a' b, " * 20_000 + "]}}",
        "codra: 1\nname: kitchen\nperception: {a: {observable_when: [" + "(" * 50_000 + "]}}",
        "codra: 1\nname: kitchen\ncontext: {a: {type: bool, label: '" + "$(a)" * 10_000 + "'}}",
        "codra: 1\nname: kitchen\nuse: {" + "".join(f"u{n}: {{template: t{n}}}, " for n in range(5_000)) + "}",
        "codra: 1\nname: kitchen\n" + "'" * 200_001,
        "codra: 1\nname: kitchen\n" + '"' * 200_000,
        "codra: 1\nname: kitchen\n" + "a: " * 100_000,
        "codra: 1\nname: kitchen\n" + "!" * 100_000,
        "codra: 1\nname: kitchen\n" + "- > 3\n" * 2_000,
        "#" * 1_000_000,
        "%" * 100_000,
        "\n" * 1_000_000,
        "codra: 1\r" * 100_000,
    ],
    ids=range(20),
)
def test_large_inputs_end_with_findings(text: str) -> None:
    assert rules_of(text)


def test_the_garbage_collector_runs_again_after_loading() -> None:
    loaded("codra: 1\nname: [")

    assert gc.isenabled()


def test_loading_does_not_import_the_modules_of_a_spec(tmp_path: Path) -> None:
    (tmp_path / "dangerous.py").write_text("raise SystemExit('imported')")
    sys.path.insert(0, str(tmp_path))
    try:
        text = "codra: 1\nname: a\nperception: {a: {call: dangerous:f, returns: {x: {type: bool}}, identifies: {b: x}}}"
        loaded(text)
    finally:
        sys.path.remove(str(tmp_path))

    assert "dangerous" not in sys.modules


def test_loading_opens_only_the_spec_and_its_parts(tmp_path: Path) -> None:
    import subprocess

    script = (
        "import sys\nfrom pathlib import Path\nfrom codra_dsl.language.load import load_spec\n"
        "import jsonschema\nroot = Path(sys.argv[1])\nload_spec(root / 'warm.yaml', root)\nseen = []\n"
        "sys.addaudithook(lambda event, arguments: seen.append((event, arguments)))\n"
        "load_spec(root / 'specs' / 'lab.yaml', root)\nload_spec(root / 'broken.yaml', root)\n"
        "bad = ('socket', 'subprocess', 'os.system', 'os.exec', 'exec', 'import', 'ctypes', 'os.remove', 'os.mkdir')\n"
        "print([event for event, _ in seen if event.startswith(bad)])\n"
        "print(sorted({str(arguments[0]) for event, arguments in seen if event == 'open'}))\n"
    )
    (tmp_path / "specs" / "parts").mkdir(parents=True)
    (tmp_path / "specs" / "lab.yaml").write_text(LAB)
    (tmp_path / "specs" / "parts" / "machine.yaml").write_text(MACHINE)
    (tmp_path / "broken.yaml").write_text("codra: 1\nname: a\nperception: {a: {cal: os:system}}\ninclude: [b.yaml]\n")
    (tmp_path / "warm.yaml").write_text("codra: 1\nname: a\nskills: {a: {preview: b}}\n")
    done = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path)], capture_output=True, text=True, check=True, cwd=ROOT
    )
    events, opened = done.stdout.splitlines()

    assert events == "[]"
    assert opened == str(
        [str(tmp_path / name) for name in ("broken.yaml", "specs/lab.yaml", "specs/parts/machine.yaml")]
    )
