"""Checks of `call` and its arguments against real modules beside a spec, which are read and never imported."""

from __future__ import annotations

import sys
from pathlib import Path
from time import process_time

import pytest

from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.language.load import load_spec
from codra_dsl.language.load.called_modules import MAX_MODULE_BYTES

SPEC = """\
codra: 1
name: bench
context:
  near: {type: bool, source: main_execution}
  clean: {type: bool}
resources:
  camera: {}
  vision: {slots: 1}
perception:
  look:
    call: bench.perception:look
    with: {gain: 3}
    uses: {camera: read, vision: slot}
    given: [near]
    returns: {dirt: {type: float}}
    identifies: {clean: dirt < 3}
"""

LOOK = "def look(*, camera, gain, near, job):\n    return {'dirt': 0.0}\n"


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A project in which `bench.perception:look` takes the arguments that the spec passes."""
    package = tmp_path / "bench"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "perception.py").write_text(LOOK)
    return tmp_path


def load_findings(root: Path, text: str = SPEC) -> tuple[Diagnostic, ...]:
    (root / "spec.yaml").write_text(text)
    return load_spec(root / "spec.yaml", root)[1]


def rules_and_help(root: Path, text: str = SPEC) -> list[tuple[str, str]]:
    return [(finding.rule.name, finding.help) for finding in load_findings(root, text)]


def with_module(root: Path, text: str) -> list[tuple[str, str]]:
    """Return the rules and help of the findings with this text of the module."""
    (root / "bench" / "perception.py").write_text(text)
    return rules_and_help(root)


def test_a_call_that_fits_gives_no_finding(project: Path) -> None:
    assert load_findings(project) == ()


# Modules and functions


@pytest.mark.parametrize(
    ("call", "help_text"),
    [
        ("bench.percepton:look", "did you mean 'bench.perception'?"),
        ("bnch.perception:look", "did you mean 'bench.perception'?"),
        ("benchperception:look", "did you mean 'bench.perception'?"),
        ("bench.vision:look", "create this module, or use the name of the module that contains the function"),
        ("bench.perception.deep:look", "create this module, or use the name of the module that contains the function"),
        ("bench.perception:lok", "did you mean 'look'?"),
        ("bench.perception:measure_distance", "the module has 'look'"),
    ],
)
def test_a_call_of_a_missing_function_is_reported_with_help(project: Path, call: str, help_text: str) -> None:
    (finding,) = load_findings(project, SPEC.replace("bench.perception:look", call))

    assert (finding.rule.name, finding.help) == ("call-not-found", help_text)
    assert finding.place.span.line == 11


@pytest.mark.parametrize("call", ["numpy:mean", "elsewhere.perception:look", "perception:look", "bench2.seeing:look"])
def test_a_package_outside_the_project_may_be_installed(project: Path, call: str) -> None:
    assert load_findings(project, SPEC.replace("bench.perception:look", call)) == ()


@pytest.mark.parametrize("call", ["{}:look", "bench.{}:look", "{}.perception:look"])
def test_a_module_with_a_very_long_name_is_searched_in_a_short_time(project: Path, call: str) -> None:
    start_s = process_time()

    load_findings(project, SPEC.replace("bench.perception:look", call.format("a" * 2000)))

    assert process_time() - start_s < 1


def test_modules_may_be_in_src(tmp_path: Path) -> None:
    package = tmp_path / "src" / "bench"
    package.mkdir(parents=True)
    (package / "perception.py").write_text(LOOK)

    assert load_findings(tmp_path) == ()
    assert rules_and_help(tmp_path, SPEC.replace(":look", ":lok")) == [("call-not-found", "did you mean 'look'?")]


def test_a_function_may_be_in_a_package_or_in_a_module_beside_the_spec(project: Path) -> None:
    (project / "bench" / "__init__.py").write_text(LOOK)
    (project / "one.py").write_text(LOOK)

    assert load_findings(project, SPEC.replace("bench.perception:look", "bench:look")) == ()
    assert load_findings(project, SPEC.replace("bench.perception:look", "one:look")) == ()


def test_a_missing_module_is_one_finding_for_all_its_callers(project: Path) -> None:
    second = SPEC.partition("perception:\n")[2].replace("  look:", "  look_again:").replace(":look", ":again")
    text = SPEC.replace("bench.perception", "bench.percepton") + second.replace("bench.perception", "bench.percepton")
    (finding,) = load_findings(project, text)

    assert [other.message for other in finding.related] == ["also in algorithm 'look_again'"]


@pytest.mark.parametrize(
    "text",
    [
        "def __getattr__(name):\n    return print\n",
        "from elsewhere import *\n",
        "from elsewhere import look\n",
        "import look\n",
        "look = make()\n",
        "try:\n    from a import look\nexcept ImportError:\n    look = None\n",
        "if True:\n    def look(): pass\n",
        "with a as (look, b):\n    pass\n",
        "(look := 3)\n",
        "globals()['look'] = print\n",
        "this is no Python\n",
        "def look(): pass\ndef look(x): pass\n",
        "@decorated\ndef look(): pass\n",
        "class look(Base): pass\n",
        "@dataclass\nclass look:\n    camera: int\n",
    ],
)
def test_uncertain_definitions_are_not_reported(project: Path, text: str) -> None:
    assert with_module(project, text) == []


def test_a_compiled_module_and_a_package_with_a_path_may_have_any_name(project: Path) -> None:
    (project / "bench" / "fast.cpython-311-x86_64-linux-gnu.so").touch()
    assert load_findings(project, SPEC.replace("bench.perception:look", "bench.fast:look")) == ()

    (project / "bench" / "__init__.py").write_text("__path__.append('elsewhere')\n")
    assert load_findings(project, SPEC.replace("bench.perception:look", "bench.other:look")) == ()


def test_a_folder_without_python_is_not_a_package(tmp_path: Path) -> None:
    (tmp_path / "bench" / "pictures").mkdir(parents=True)
    (tmp_path / "bench" / "bench.yaml").touch()

    assert load_findings(tmp_path) == ()


def test_a_package_may_do_without_init(tmp_path: Path) -> None:
    (tmp_path / "code" / "bench").mkdir(parents=True)
    (tmp_path / "code" / "bench" / "perception.py").write_text(LOOK)

    assert rules_and_help(tmp_path, SPEC.replace("bench.perception", "code.bnch.perception")) == [
        ("call-not-found", "did you mean 'code.bench.perception'?")
    ]


# Arguments


@pytest.mark.parametrize(
    ("signature", "help_text"),
    [
        ("*, camera, gain, near, job", None),
        ("camera, gain, near, job", None),
        ("job, **given", None),
        ("*, camera, gain=2, near, job, extra=None", None),
        ("*, camera, gian, near, job", "did you mean 'gian'?"),
        ("*, camera, contrast, near, job", "did you mean 'contrast', which is missing?"),
        ("*, camera, near, job", "the function takes 'camera', 'job', 'near'"),
        ("*, camera, gain, near", "add the parameter 'job': every perception function gets it"),
        ("", "the function takes no arguments"),
        ("camera, /, gain, near, job", "make it a keyword argument: arguments are passed only by name"),
        (
            "*, camera, gain, near, job, extra",
            "add 'extra' under 'with', 'uses' or 'given', or give the parameter a default value",
        ),
    ],
)
def test_a_function_must_take_all_passed_arguments_and_get_all_required_ones(
    project: Path, signature: str, help_text: str | None
) -> None:
    findings = with_module(project, f"def look({signature}):\n    return {{}}\n")

    assert findings == [] if help_text is None else ("call-arguments", help_text) in findings


@pytest.mark.parametrize(
    ("body", "help_text"),
    [
        ("def perceive(self, camera, gain, near, job): pass", None),
        ("def perceive(self, *, camera, gain, near, job): pass\n    def setup(self, *, gain): pass", None),
        ("def perceive(self, camera, gian, near, job): pass", "did you mean 'gian'?"),
        ("def perceive(self): pass", "the function takes no arguments"),
        ("@staticmethod\n    def perceive(): pass", None),
        ("perceive = make()", None),
        ("if True:\n        def perceive(): pass", None),
    ],
)
def test_a_class_takes_the_arguments_of_its_perceive(project: Path, body: str, help_text: str | None) -> None:
    findings = with_module(project, f"class look:\n    {body}\n")

    assert findings == [] if help_text is None else ("call-arguments", help_text) in findings


def test_a_class_without_perceive_is_reported(project: Path) -> None:
    (project / "bench" / "perception.py").write_text("class look:\n    def see(self, job): pass\n")
    (finding,) = load_findings(project)

    assert finding.rule.name == "call-not-found"
    assert (
        finding.message == "class 'look' of module 'bench.perception', which algorithm 'look' calls, has no 'perceive'"
    )
    assert finding.help == "add a method 'perceive', or use the name of a function"


def test_several_arguments_that_a_function_does_not_take_are_one_finding(project: Path) -> None:
    (project / "bench" / "perception.py").write_text("def look(job): return {}\n")
    (finding,) = load_findings(project)

    assert "does not take the arguments 'gain', 'camera', 'near', but algorithm 'look' gives them" in finding.message


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [("gain: 3", "gian: 3", 12), ("camera: read", "camra: read", 13), ("given: [near]", "given: [neer]", 14)],
)
def test_the_place_is_that_of_the_argument(project: Path, old: str, new: str, line: int) -> None:
    declared = SPEC.replace("  near: {", "  near: {type: bool, source: main_execution}\n  neer: {")
    declared = declared.replace("  camera: {}", "  camera: {}\n  camra: {}")
    (finding,) = load_findings(project, declared.replace(old, new))

    assert finding.help.startswith("did you mean '")
    assert finding.place.span.line == line + 2


def test_undeclared_or_unreadable_arguments_are_not_compared_with_a_function(project: Path) -> None:
    assert (
        load_findings(project, SPEC.replace("camera: read", "camra: read")) == ()
    )  # `check` reports the missing resource
    assert [finding.rule.name for finding in load_findings(project, SPEC.replace("{gain: 3}", "{gain-1: 3}"))] == [
        "ill-formed-name"
    ]


def test_uses_of_a_template_have_their_own_arguments_and_a_mistake_is_reported_once(project: Path) -> None:
    text = """\
codra: 1
name: bench
resources: {camera: {}}
templates:
  jar:
    context: {$(instance)_full: {type: bool}}
    perception:
      look_into_$(instance):
        call: bench.perception:look
        with: {gain: 1, nearr: $(instance)}
        uses: {camera: read}
        returns: {level: {type: float}}
        identifies: {$(instance)_full: level > 1}
use:
  sugar: {template: jar}
  salt: {template: jar}
"""
    (finding,) = load_findings(project, text)

    assert finding.help == "did you mean 'near'?"
    assert finding.place.span.line == 10


# Safety


def test_modules_are_not_run(project: Path) -> None:
    ran = project / "ran"
    text = f"open({str(ran)!r}, 'w').close()\nraise SystemExit\n{LOOK}"

    assert with_module(project, text) == []
    assert not ran.exists()
    assert not any(name == "bench" or name.startswith("bench.") for name in sys.modules)


@pytest.mark.parametrize(
    "text",
    [
        "(" * 100_000,
        "-" * 200_000 + "a",
        "a" + ".a" * 100_000,
        "\0",
        "\ud800".encode("utf-8", "surrogatepass").decode("latin-1"),
    ],
    ids=["parentheses", "signs", "attributes", "zero", "no text"],
)
def test_an_unparsable_module_is_not_checked(project: Path, text: str) -> None:
    assert with_module(project, text) == []


def test_modules_that_are_too_large_or_not_files_or_elsewhere_are_not_checked(
    project: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    module = project / "bench" / "perception.py"
    module.write_text("#" * MAX_MODULE_BYTES + "\n")
    assert load_findings(project) == ()

    module.unlink()
    module.mkdir()
    assert load_findings(project) == ()

    module.rmdir()
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "perception.py"
    elsewhere.write_text("def other(): pass\n")
    module.symlink_to(elsewhere)
    assert load_findings(project) == ()


def test_the_spec_names_the_modules_on_which_its_findings_depend(project: Path) -> None:
    (project / "spec.yaml").write_text(SPEC)
    spec, _ = load_spec(project / "spec.yaml", project)
    assert spec is not None

    assert "bench/perception.py" in spec.modules
    assert "src/bench/perception.py" in spec.modules
