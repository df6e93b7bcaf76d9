"""Emitted text: formatted, typed, safe and reproducible; and the trees of P1's Figure 4 on the real runtime."""

from __future__ import annotations

import ast
import dataclasses
import hashlib
import inspect
import json
import math
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from py_trees.composites import Selector
from py_trees.display import unicode_tree

from codra_dsl.generation.algorithm2 import plan
from codra_dsl.generation.build_plan.names import ENTRY_NAMES, MODULE_NAMES
from codra_dsl.generation.emit import emit, package_text
from codra_dsl.generation.emit.conditions import ConditionError
from codra_dsl.generation.emit.conditions import condition_with_words as emitted_condition
from codra_dsl.generation.emit.declarations import DEFAULTS
from codra_dsl.generation.emit.layout import call, lay_out
from codra_dsl.generation.emit.literals import literal, prose, text_literal
from codra_dsl.integrations.inspection.loading import load_start
from codra_dsl.language.check.checked.spec import CheckedSpec
from codra_dsl.language.diagnostics import Place, Span
from codra_dsl.language.model import Access, Kind, Resource, Returned, Topic, Usage, Use, ValueType
from codra_dsl.runtime import ContextManager, SimClock
from codra_dsl.runtime.observers.observer import ObserverModel
from codra_dsl.runtime.values import model as runtime_model
from generated import lab
from tests.language.check.checked_specs import (
    ShortAlgorithm,
    checked_spec,
    condition,
    place,
    reference,
    setting,
    skill,
    variable,
)
from tests.runtime.forests import World, takes
from tests.type_checker import run_mypy

ROOT = Path(__file__).parents[3]


def world_algorithm(
    name: str, identifies: list[str | tuple[str, str]], needs: list[Any] | None = None, **fields: Any
) -> ShortAlgorithm:
    """Return an algorithm whose perception function reads the handle `world`, and returns the value `seen`."""
    world = Usage(resource=reference("world"), access=Access.READ, place=place())
    seen = Returned(name="seen", type=ValueType(kind=Kind.BOOL), optional=True, place=place())
    default_fields = {
        "call": "tests.runtime.forests:look",
        "parameters": {"algorithm": name},
        "uses": (world,),
        "returns": (seen,),
    }
    return ShortAlgorithm(name=name, identifies=identifies, needs=needs or (), **(default_fields | fields))


def rich() -> CheckedSpec:
    """Return a spec with every form of output: alternatives, joined trees, all types, long texts, given values."""
    long = condition(
        "near and not (bright or known(open) and age(open) > 10 s) and (near or bright) and not open and known(near)",
        *("bright", "near", "open"),
        python="value('near') & ~(value('bright') | (known('open') & (age('open') > 10.0))) & "
        "(value('near') | value('bright')) & ~value('open') & known('near')",
    )
    markers = condition("markers >= 3", "seen", python="value('seen')")
    return checked_spec(
        [
            world_algorithm(
                "measure", ["near"], ["robot_is_localized"], parameters={"algorithm": "measure", "limit": 0.5}
            ),
            world_algorithm("localize_lid", ["open", "locked"], ["near", long], accept=[markers], feedback=["open"]),
            world_algorithm("feel_lid", ["open"], ["near"], given=["pose"], rank=2, timeout_s=math.inf),
            world_algorithm("read_label", ["labelled"], ["near"]),
            world_algorithm("read_lamp", ["lamp_on"], ["near"]),
            world_algorithm("feel_lamp", ["lamp_on"], ["near"], rank=2),
            world_algorithm("read_mode", [("mode", "first_of(('idle', value('seen')), ('busy', ~value('seen')))")]),
        ],
        skills=[skill("open_lid", ["locked", "mode"], ["open"]), skill("read", ["labelled", "speed"])],
        observers=[setting("lid", "open", "locked", priority=5), setting("face", "labelled", "lamp_on", period_s=0.5)],
        variables=[
            variable("bright", sources=(reference("main_execution"), reference("lamp_agent"))),
            variable("pose", type=ValueType(kind=Kind.FLOAT, unit="m", range=(-1.0, math.inf)), sources=main()),
            variable(
                "speed",
                type=ValueType(kind=Kind.INT, range=(0.0, 3.0)),
                sources=main(),
                valid_for_s=2.5,
                ros=Topic(topic="/speed", type="std_msgs/msg/Int8", field="data", writer="main_execution"),
            ),
            variable("title", type=ValueType(kind=Kind.STR), sources=main(), history=7),
            variable("mode", type=ValueType(kind=Kind.ENUM, values=("idle", "busy")), label="Betriebsart"),
        ],
        resources=[Resource(name="world", place=place()), Resource(name="vision", place=place(), slots=1)],
    )


def main() -> tuple[Any, ...]:
    return (reference("main_execution"),)


def emitted(spec: CheckedSpec) -> dict[str, str]:
    return {"__init__.py": package_text(), **emit(plan(spec))}


def written(spec: CheckedSpec, folder: Path) -> Path:
    for path, text in emitted(spec).items():
        (folder / "generated" / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / "generated" / path).write_text(text, "utf-8")
    return folder / "generated"


def run(*command: str | Path, cwd: Path = ROOT) -> str:
    done = subprocess.run(command, cwd=cwd, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
    assert done.returncode == 0, done.stdout
    return done.stdout


# Form


@pytest.mark.parametrize("spec", [rich(), checked_spec([]), checked_spec([ShortAlgorithm(name="p", identifies=["a"])])])
def test_generated_code_is_as_ruff_formats_it_and_without_findings(spec: CheckedSpec, tmp_path: Path) -> None:
    made = written(spec, tmp_path)
    ruff = Path(sys.executable).with_name("ruff")

    run(ruff, "format", "--isolated", "--line-length", "120", "--diff", made)
    # Names come from specs and may be long: the project makes the same exception for `generated`.
    own = ("--config", ROOT / "pyproject.toml", "--config", f"src = ['{ROOT}']", "--extend-ignore", "E501")
    run(ruff, "check", *own, made)


NAMES = st.sampled_from(["near", "centrifuge_in_observable_distance", "x", "pcr_cycler_base_in_FOV_as_seen_from_above"])
NUMBERS = st.sampled_from(["0", "3", "-1", "0.25", "1e-07", "3.141592653589793", "12345678901234567000.0"])
TEXTS = st.sampled_from(["'open'", "'a \"quoted\" text'", '"it\'s"', "'both \" and \\''", "'\\\\'", "'\\n'", "'ü'"])
VALUES = st.one_of(
    st.builds("value({!r})".format, NAMES),
    st.builds("age({!r})".format, NAMES),
    st.builds("-value({!r})".format, NAMES),
    NUMBERS,
)


def _arithmetic(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    operators = st.sampled_from("+-*/")
    return st.one_of(
        st.builds("({} {} {})".format, inner, operators, inner),
        st.builds("({} {} value('z') {} {})".format, inner, operators, operators, inner),
        st.builds("minimum({}, {}, value('y'))".format, inner, inner),
        st.builds("abs(-value('x') * {})".format, inner),
    )


NUMERIC = st.recursive(VALUES, _arithmetic, max_leaves=6)
SIMPLE = st.one_of(
    st.builds("known({!r})".format, NAMES),
    st.builds("value({!r})".format, NAMES),
    st.builds("(value({!r}) == {})".format, NAMES, TEXTS),
    st.builds("value({!r}).is_in({}, {}, 'another_member_of_it')".format, NAMES, TEXTS, TEXTS),
    st.builds("(value('w') {} {})".format, st.sampled_from(["<", "<=", ">", ">=", "==", "!="]), NUMERIC),
)
CONDITIONS = st.recursive(
    SIMPLE,
    lambda inner: st.one_of(
        st.builds("({} & {})".format, inner, inner),
        st.builds("({} | {} | {})".format, inner, inner, inner),
        st.builds("~({})".format, inner),
        st.builds("choose({}, {}, literal(False))".format, inner, inner),
        st.builds("between({}, {})".format, inner, inner),
        st.builds("confirmed({}, 2, 3)".format, inner),
    ),
    max_leaves=8,
)


def in_a_call(python: str) -> str:
    expression, _ = emitted_condition(python)
    return lay_out(call("Precondition", '"text"', expression, "perception"))


@settings(max_examples=8)
@given(st.lists(CONDITIONS, min_size=40, max_size=40))
def test_conditions_of_any_length_are_laid_out_as_ruff_does(conditions: list[str]) -> None:
    """Conditions are checked forty at a time, because ruff has to be started each time."""
    text = "".join(f"{in_a_call(python)}\n" for python in conditions)

    done = subprocess.run(
        [Path(sys.executable).with_name("ruff"), "format", "--isolated", "--line-length", "120", "-"],
        input=text,
        text=True,
        capture_output=True,
        check=True,
    )

    assert done.stdout == text


@given(CONDITIONS)
def test_a_condition_has_the_same_meaning_after_layout(python: str) -> None:
    words = {**vars(sys.modules["codra_dsl.runtime.values.conditions"])}
    expression, used = emitted_condition(python)

    laid = lay_out(expression)

    assert repr(eval(f"({laid})", words)) == repr(eval(python, words))
    called = {node.id for node in ast.walk(ast.parse(python)) if isinstance(node, ast.Name)}
    assert used == called - {"abs"}


@pytest.mark.parametrize(
    "python",
    [
        "__import__('os').system('true')",
        "value('a').evil()",
        "value('a').__class__",
        "open('x')",
        "value(name='a')",
        "value(*names)",
        "[value('a')]",
        "lambda: value('a')",
        "value('a') if value('b') else value('c')",
        "value('a') and value('b')",
        "value('a') < value('b') < value('c')",
        "value",
        "f'{value}'",
        "b'bytes'",
        "value('a'",
        "",
    ],
)
def test_a_condition_in_other_words_than_the_runtimes_is_refused(python: str) -> None:
    with pytest.raises(ConditionError):
        emitted_condition(python)


@given(st.one_of(st.text(), st.booleans(), st.integers(), st.floats(allow_nan=False)))
def test_literals_are_ascii_and_give_the_value_back(value: bool | int | float | str) -> None:
    made = literal(value)

    assert made.isascii()
    assert eval(made, {"math": math}) == value


# Types


TYPED_USE = """
from collections.abc import Callable
from typing import assert_type, Literal
from codra_dsl.runtime import Reading, SimClock
from generated import lab

def look() -> bool: return True

with lab.start(clock=SimClock(), resources={}) as codra:
    assert_type(codra, lab.Lab)
    assert_type(codra.get("open"), Reading[bool])
    assert_type(codra.get("pose"), Reading[float])
    assert_type(codra.get("speed"), Reading[int])
    assert_type(codra.get("title"), Reading[str])
    assert_type(codra.get("mode"), Reading[Literal["idle", "busy"]])
    assert_type(codra.decide("open", otherwise=look), bool)
    assert_type(codra.decide("pose", otherwise=look, max_age_s=1.0), float | bool)
    codra.get("opne")  # type: ignore[call-overload]
    codra.declare("opne")  # type: ignore[call-overload]
    codra.set("mode", "idel")  # type: ignore[call-overload]
    codra.set("speed", 3)
    codra.expect("open_lid", "raed")  # type: ignore[arg-type]
"""


def test_generated_code_is_typed_and_lets_mypy_find_wrong_names(tmp_path: Path) -> None:
    """`warn_unused_ignores` makes every expected error mandatory."""
    written(rich(), tmp_path)
    written(checked_spec([ShortAlgorithm(name="p", identifies=["a"])], name="plain"), tmp_path)
    written(checked_spec([], name="empty"), tmp_path)
    packages = (tmp_path / "generated").rename(tmp_path / "compiled")  # mypy would take `generated` of this repository
    (tmp_path / "use.py").write_text(TYPED_USE.replace("from generated", "from compiled"))

    done = run_mypy(str(tmp_path / "use.py"), str(packages))
    assert done.returncode == 0, done.stdout


def test_typed_access_takes_what_the_runtime_takes(tmp_path: Path) -> None:
    lab = type(start(rich(), tmp_path)(clock=SimClock(), resources={"world": World()}))

    for name in ("get", "set", "declare", "decide"):
        ours, theirs = inspect.signature(getattr(lab, name)), inspect.signature(getattr(ContextManager, name))
        assert [(parameter.name, parameter.kind, parameter.default) for parameter in ours.parameters.values()] == [
            (parameter.name, parameter.kind, parameter.default) for parameter in theirs.parameters.values()
        ]


# Safety

ALLOWED_NODES = (
    *(ast.Module, ast.Import, ast.ImportFrom, ast.alias, ast.Assign, ast.AnnAssign, ast.FunctionDef, ast.arguments),
    *(ast.arg, ast.Return, ast.Expr, ast.Constant, ast.Call, ast.keyword, ast.Name, ast.Load, ast.Store, ast.Attribute),
    *(ast.Tuple, ast.List, ast.Dict, ast.Compare, ast.BinOp, ast.UnaryOp, ast.operator, ast.unaryop, ast.cmpop),
    *(ast.Subscript, ast.Starred),
)
HOSTILE = st.one_of(
    st.text(max_size=20),
    st.sampled_from(
        [
            '"""\nimport os\n"""',
            "'''",
            '"); print("',
            "\\",
            '\\"',
            "{{ 7 * 7 }}",
            "{% raw %}",
            "\n\nimport os",
            "\r",
            "\u2028",
            "\u202e",
            "\x00",
            "#",
        ]
    ),
)


@given(HOSTILE, HOSTILE, HOSTILE)
def test_no_text_of_a_spec_becomes_code(label: str, hostile_text: str, member: str) -> None:
    spec = checked_spec(
        [
            ShortAlgorithm(
                name="p",
                identifies=["a"],
                call=hostile_text,
                parameters={"text": label},
                needs=[condition(hostile_text, "x", python=f"value('x') == {member!r}")],
            )
        ],
        variables=[variable("x", label=label, type=ValueType(kind=Kind.ENUM, values=(member,)), sources=main())],
        uses=[Use(instance="lab", template="t", place=place(), template_place=place())],
    )

    for path, text in emit(plan(spec)).items():
        assert text.isascii()
        if path == "lab/lab.py":
            tree = ast.parse(text)
            assert {type(node) for node in ast.walk(tree) if not isinstance(node, ALLOWED_NODES)} == set()
            strings = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}
            assert {label, hostile_text, member} <= strings | {"x"}
            called_names = {
                node.func.id
                for node in ast.walk(tree)
                if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
            }
            assert called_names <= MODULE_NAMES


@given(HOSTILE)
def test_a_file_name_cannot_break_out_of_a_docstring(name: str) -> None:
    inside = prose(f"specs/{name}.yaml")
    (statement,) = ast.parse(f'"""Made from {inside}.\n"""').body

    assert isinstance(statement, ast.Expr)
    assert isinstance(statement.value, ast.Constant)


def test_modules_import_only_names_that_specs_cannot_take() -> None:
    files = emit(plan(rich()))

    for path, reserved in (("lab/lab.py", MODULE_NAMES), ("lab/__init__.py", ENTRY_NAMES | {"lab"})):
        imports = [node for node in ast.walk(ast.parse(files[path])) if isinstance(node, ast.Import | ast.ImportFrom)]
        assert {alias.name for node in imports for alias in node.names} <= reserved


def test_left_out_fields_are_the_defaults_of_the_runtime() -> None:
    runtime_classes = {**vars(runtime_model), "ObserverModel": ObserverModel}
    for name, defaults in DEFAULTS.items():
        fields = {field.name: field for field in dataclasses.fields(runtime_classes[name])}
        for key, text in defaults.items():
            assert isinstance(text, str)
            factory = fields[key].default_factory
            runtime_default = fields[key].default if factory is dataclasses.MISSING else factory()
            assert eval(text, {"math": math}) == runtime_default, f"{name}.{key}"


# Records


def test_the_manifest_has_the_digest_of_every_output_except_the_places() -> None:
    files = emit(plan(rich()))
    manifest = json.loads(files["lab/manifest.json"])

    digests = {
        path.removeprefix("lab/"): f"sha256:{hashlib.sha256(text.encode()).hexdigest()}" for path, text in files.items()
    }

    assert manifest["outputs"].items() < digests.items()
    assert digests.keys() - manifest["outputs"] == {"manifest.json", "sources.json"}
    assert manifest["variables"]["mode"] == {"type": "enum", "values": ["idle", "busy"]}
    assert manifest["spec"] == "specs/lab.yaml"


def shift_lines(spec: CheckedSpec, lines: int) -> CheckedSpec:
    """Return the spec after some lines were added at its top."""

    def shift(value: object) -> Any:
        if isinstance(value, Place):
            span = value.span
            return Place(Span(span.file, span.line + lines, span.column, span.end_line + lines, span.end_column))
        if isinstance(value, tuple):
            return tuple(map(shift, value))
        if isinstance(value, Mapping):
            return {key: shift(item) for key, item in value.items()}
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            return dataclasses.replace(
                value,
                **{
                    dataclass_field.name: shift(getattr(value, dataclass_field.name))
                    for dataclass_field in dataclasses.fields(value)
                },
            )
        return value

    return shift(spec)  # type: ignore[no-any-return]


def test_lines_added_to_a_spec_change_its_places_only() -> None:
    before, after = emit(plan(rich())), emit(plan(shift_lines(rich(), 7)))

    assert [path for path in before if before[path] != after[path]] == ["lab/sources.json"]
    assert json.loads(after["lab/sources.json"])["lab/context/open"] == {"file": "specs/lab.yaml", "line": 8}


def test_sources_know_elements_conditions_and_uses() -> None:
    made_by_use = dataclasses.replace(place(12, "specs/parts/machine.yaml"), use=place(27).span)
    files = emit(plan(checked_spec([ShortAlgorithm(name="p", identifies=["a"], needs=["x"], place=made_by_use)])))

    sources = json.loads(files["lab/sources.json"])

    assert sources["lab/perception/p"] == {
        "file": "specs/parts/machine.yaml",
        "line": 12,
        "use": {"file": "specs/lab.yaml", "line": 27},
    }
    assert {"lab/perception/p/observable_when/0", "lab/perception/p/identifies/a", "lab/observer/p"} <= sources.keys()


@pytest.mark.parametrize(
    "change",
    [
        {"call": "robot.other:look"},
        {"timeout_s": 6.0},
        {"needs": ["y"]},
        {"identifies": [("a", "~value('seen')")]},
        {"parameters": {"limit": 1}},
    ],
)
def test_the_models_digest_changes_with_the_meaning_of_a_spec(change: dict[str, Any]) -> None:
    pi = ShortAlgorithm(name="p", identifies=["a"], needs=["x"])

    digests = [
        json.loads(emit(plan(checked_spec([variant])))["lab/manifest.json"])["model"]
        for variant in (pi, pi, dataclasses.replace(pi, **change))
    ]

    assert digests[0] == digests[1] != digests[2]


def test_the_graph_has_dependencies_and_no_places() -> None:
    graph = json.loads(emit(plan(rich()))["lab/graph.json"])

    edges = {(edge["source"], edge["kind"], edge["target"]) for edge in graph["edges"]}

    assert ("lab/perception/localize_lid", "requires", "lab/context/near") in edges
    assert ("lab/perception/localize_lid", "feedback", "lab/context/open") in edges
    assert ("lab/skill/open_lid", "decides_on", "lab/context/open") in edges
    assert not any("line" in node for node in graph["nodes"])
    assert {node["id"] for node in graph["nodes"]} >= {end for source, _, target in edges for end in (source, target)}


# On the real runtime


def start(spec: CheckedSpec, folder: Path) -> Any:
    return load_start(emit(plan(spec)), spec.spec.name, folder)


@contextmanager
def started(spec: CheckedSpec, folder: Path, world: World) -> Iterator[tuple[Any, SimClock]]:
    clock = SimClock()
    with start(spec, folder)(clock=clock, resources={"world": world}) as manager:
        yield manager, clock


def rendered(manager: Any, name: str) -> str:
    return unicode_tree(manager._forest.observers[name].tree)


FIGURE_4 = """\
[-] lid
    --> control flag
    --> near
    --> base_in_view
    --> due or running
    --> localize_lid
    --> markers >= 3
    --> identify open
    --> identify locked
"""

ALTERNATIVES = """\
[-] lid
    --> control flag
    [o] alternatives
        [-] localize_lid
            --> near
            --> due or running
            --> localize_lid
            --> identify open
            --> identify locked
        [-] feel_lid
            --> known(pose)
            --> due or running
            --> feel_lid
            --> identify open
"""

JOINED = """\
[-] face
    --> control flag
    --> near
    /_/ joined
        -^- read_label
            [-] read_label
                --> due or running
                --> read_label
                --> identify labelled
        -^- read_lamp
            [-] read_lamp
                --> due or running
                --> read_lamp
                --> identify lamp_on
"""

WORLD = [Resource(name="world", place=place())]


def test_a_tree_shows_the_order_of_figure_4(tmp_path: Path) -> None:
    markers = condition("markers >= 3", "seen", python="value('seen')")
    lid = world_algorithm("localize_lid", ["open", "locked"], ["near", "base_in_view"], accept=[markers])
    spec = checked_spec([lid], observers=[setting("lid", "open", "locked")], resources=WORLD)

    with started(spec, tmp_path, World()) as (manager, _):
        assert rendered(manager, "lid") == FIGURE_4


def test_alternatives_show_their_own_preconditions(tmp_path: Path) -> None:
    spec = checked_spec(
        [
            world_algorithm("localize_lid", ["open", "locked"], ["near"]),
            world_algorithm("feel_lid", ["open"], given=["pose"], rank=2),
        ],
        observers=[setting("lid", "open", "locked")],
        resources=WORLD,
    )

    with started(spec, tmp_path, World()) as (manager, _):
        assert rendered(manager, "lid") == ALTERNATIVES


def test_joined_algorithms_run_side_by_side_under_their_preconditions(tmp_path: Path) -> None:
    with started(joined(), tmp_path, World()) as (manager, _):
        assert rendered(manager, "face") == JOINED


def joined() -> CheckedSpec:
    return checked_spec(
        [
            world_algorithm("read_label", ["labelled"], ["near"]),
            world_algorithm("read_lamp", ["lamp_on"], ["near"]),
        ],
        observers=[setting("face", "labelled", "lamp_on")],
        resources=WORLD,
    )


def test_a_failing_joined_algorithm_leaves_the_other_alone(tmp_path: Path) -> None:
    """The first algorithm fails immediately, again and again, while the second one takes three periods."""
    world = World(finds={"read_label": 7, "read_lamp": takes(3.0, {"seen": True})})
    with started(joined(), tmp_path, world) as (manager, clock):
        manager.set("near", True)
        manager.declare("lamp_on")
        clock.sleep(4.0)

        assert manager.get("lamp_on").value is True
        assert not manager.get("labelled").known


def test_generated_code_runs_from_decision_to_perception(tmp_path: Path) -> None:
    world = World(finds={name: {"seen": True} for name in ("measure", "localize_lid", "feel_lid", "read_mode")})
    with started(rich(), tmp_path, world) as (manager, clock):
        manager.set("robot_is_localized", True)
        manager.expect("open_lid")
        clock.sleep(3.0)

        assert manager.get("near").value is True
        assert manager.get("mode").value == "idle"
        assert manager.running() >= {"measure", "lid", "read_mode"}


def test_text_literals_choose_the_quotes_that_need_fewer_escapes() -> None:
    assert [text_literal(text) for text in ["it's", 'a "b"', "\"'"]] == ['"it\'s"', "'a \"b\"'", '"\\"\'"']


def test_every_tree_of_the_lab_that_is_checked_in_shows_the_order_of_figure_4() -> None:
    order = ["ControlFlag", "Precondition", "DueOrRunning", "Perceive", "Accept", "Identify"]
    with lab.start(clock=SimClock(), resources={"camera": None, "base": None}) as manager:
        for observer in manager._forest.observers.values():
            (control_flag, *others) = observer.tree.children
            branches = others[0].children if isinstance(others[0], Selector) else [observer.tree]
            first_kinds, *other_kinds = [[type(node).__name__ for node in branch.children] for branch in branches]
            assert type(control_flag).__name__ == "ControlFlag"

            for kinds in (first_kinds, *other_kinds):
                assert kinds == sorted(kinds, key=order.index)
                assert set(order) - set(kinds) <= {"ControlFlag", "Accept"}
            assert first_kinds.count("Identify") == len(observer.model.identifies)


def test_equal_bounds_that_are_written_differently_stay_different() -> None:
    for start, declared in ((-0.0, "real(-0.0, 1.0)"), (0.0, "real(0.0, 1.0)"), (0, "real(0, 1.0)")):
        level = variable("level", type=ValueType(kind=Kind.FLOAT, range=(start, 1.0)), sources=main())
        texts = emit(plan(checked_spec([], variables=[level], skills=[skill("enter", preview=["level"])])))

        assert any(declared in text for text in texts.values())
