"""Algorithm 2 compared with the recursion of the paper, and the gate tested with plans that have one error each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.generation.algorithm2 import plan
from codra_dsl.generation.build_plan import BuildPlan, Edge, EdgeKind, Node, NodeKind, PlanError, Tree, verify
from codra_dsl.generation.build_plan.names import MODULE_NAMES, module_name, python_name
from codra_dsl.language.check.checked.spec import CheckedSpec
from codra_dsl.language.model import ObserverSetting, Use
from tests.language.check.checked_specs import ShortAlgorithm, checked_spec, condition, place, setting, skill, variable

# The oracle is P1's Algorithm 2 as printed: a recursion that processes one variable at a time.


@dataclass
class System:
    """F with the preconditions of each tree, and C_M. The paper's procedures fill both."""

    spec: CheckedSpec
    forest: dict[frozenset[str], set[str]] = field(default_factory=dict)
    context: set[str] = field(default_factory=set)


def build_observer_system(spec: CheckedSpec) -> System:
    system = System(spec)  # 2
    for c_i in spec.decisions:  # 3 to 5
        process_context_variable(c_i, system)  # 6
    return system  # 8


def process_context_variable(c_i: str, system: System) -> None:
    if c_i in system.context:  # 11
        return  # 12
    system.context.add(c_i)  # 14
    if c_i in system.spec.producers:  # 15
        beside, o_i = tree_of(c_i, system.spec)  # 16, 17
        v_j = {name for pi in o_i for name in system.spec.algorithms[pi].needs}  # 18
        for c_j in sorted(v_j):  # 19, 20
            process_context_variable(c_j, system)  # 21
        system.forest[o_i] = v_j  # 23
        for c_j in sorted(beside):  # the other variables that the tree identifies are in force as well
            process_context_variable(c_j, system)


def tree_of(c_i: str, spec: CheckedSpec) -> tuple[set[str], frozenset[str]]:
    """Return the variables and algorithms in the tree of a variable: all that share algorithms or variables with it."""
    variables, algorithms = {c_i}, set[str]()
    while True:
        spread = {pi for name in variables for pi in spec.producers[name]}
        together = {name for pi in spread for name, _ in spec.algorithms[pi].identifies}
        for named in spec.spec.observers:
            names = {reference.name for reference in named.identifies}
            together |= names if names & together else set()
        if (spread, together) == (algorithms, variables):
            return variables, frozenset(algorithms)
        algorithms, variables = spread, together


def name_lists(names: list[str], most: int) -> st.SearchStrategy[list[str]]:
    no_names: st.SearchStrategy[list[str]] = st.just([])
    return st.lists(st.sampled_from(names), unique=True, max_size=most) if names else no_names


@st.composite
def specs(draw: st.DrawFn) -> CheckedSpec:
    """Return specs with alternatives, joined and named trees, feedback, skills, and variables from other sources."""
    count = draw(st.integers(1, 6))
    earlier = [f"given_{number}" for number in range(draw(st.integers(0, 2)))]
    algorithms, settings = list[ShortAlgorithm](), list[ObserverSetting]()
    for group in range(count):
        variables = [f"v{group}_{number}" for number in range(draw(st.integers(1, 3)))]
        feedback = draw(name_lists([f"v{other}_0" for other in range(group, count)], 1))
        needs = draw(name_lists(earlier, 3))
        first = ShortAlgorithm(
            name=f"pi_{group}_1", identifies=variables, needs=needs, given=feedback, feedback=feedback
        )
        algorithms.append(first)
        joined = draw(st.booleans())
        if joined:
            algorithms.append(replace(first, name=f"joined_{group}", identifies=[f"w{group}"]))
            variables = [*variables, f"w{group}"]
        for rank in range(2, 2 if joined else 2 + draw(st.integers(0, 2))):
            fewer = draw(st.lists(st.sampled_from(variables), unique=True, min_size=1))
            algorithms.append(
                ShortAlgorithm(
                    name=f"pi_{group}_{rank}", identifies=fewer, needs=draw(name_lists(earlier, 2)), rank=rank
                )
            )
        if joined or draw(st.booleans()):
            settings.append(setting(f"tree_{group}", *variables))
        earlier += variables
    wanted = name_lists(earlier, 3)
    skills = [skill(f"skill_{number}", draw(wanted), draw(wanted)) for number in range(draw(st.integers(0, 2)))]
    return checked_spec(draw(st.permutations(algorithms)), skills=skills, observers=settings)


@given(specs())
def test_the_plan_equals_the_result_of_the_papers_recursion(spec: CheckedSpec) -> None:
    expected = build_observer_system(spec)

    made = plan(spec)

    verify(made, spec)
    assert set(made.in_force) == expected.context
    assert {
        frozenset(branch.name for branch in tree.branches): set(tree.needs) for tree in made.forest
    } == expected.forest


@given(specs())
def test_a_variable_in_force_has_one_tree_or_another_source(spec: CheckedSpec) -> None:
    made = plan(spec)

    trees = [name for tree in made.forest for name in tree.identifies]
    outside = [name for name in made.in_force if name not in spec.producers]

    assert sorted(trees + outside) == sorted(made.in_force)


# Contents of trees


def lab() -> CheckedSpec:
    """Return a spec of two machines as in P1, Figure 4: distance, view, lid, and a second way to see the lid."""
    return checked_spec(
        [
            ShortAlgorithm(
                name="localize_lid", identifies=["open", "locked"], needs=["near", "base_in_view", "lid_in_view"]
            ),
            ShortAlgorithm(name="feel_lid", identifies=["open"], needs=["arm_at_lid"], rank=2),
            ShortAlgorithm(name="find_in_view", identifies=["base_in_view", "lid_in_view"], needs=["near"]),
            ShortAlgorithm(name="measure_distance", identifies=["near", "in_reach"], needs=["robot_is_localized"]),
            ShortAlgorithm(name="read_label", identifies=["labelled"], needs=["near"]),
            ShortAlgorithm(name="read_lamp", identifies=["lamp_on"], needs=["near"]),
        ],
        skills=[skill("open_lid", ["locked"], ["open"]), skill("read", ["lamp_on"])],
        observers=[setting("lid", "open", "locked", period_s=2.0, priority=5), setting("face", "labelled", "lamp_on")],
    )


def tree_named(made: BuildPlan, name: str) -> Tree:
    return next(tree for tree in made.forest if tree.name == name)


def algorithms_of(tree: Tree) -> list[list[str]]:
    return [[branch.name for branch in group] for group in tree.groups]


def test_variables_of_one_algorithm_share_a_tree() -> None:
    tree = tree_named(plan(lab()), "find_in_view")

    assert tree.identifies == ("base_in_view", "lid_in_view")
    assert tree.needs == ("near",)


def test_algorithms_that_share_a_variable_are_alternatives_by_rank() -> None:
    tree = tree_named(plan(lab()), "lid")

    assert algorithms_of(tree) == [["localize_lid", "feel_lid"]]
    assert tree.needs == ("near", "base_in_view", "lid_in_view", "arm_at_lid")


def test_trees_are_joined_where_observers_names_their_variables_together() -> None:
    made = plan(lab())

    assert algorithms_of(tree_named(made, "face")) == [["read_label"], ["read_lamp"]]


def test_trees_are_separate_unless_observers_joins_them() -> None:
    apart = plan(
        checked_spec(
            [
                ShortAlgorithm(name="p", identifies=["a"], needs=["x"]),
                ShortAlgorithm(name="q", identifies=["b"], needs=["x"]),
            ]
        )
    )

    assert [algorithms_of(tree) for tree in apart.forest] == [[["p"]], [["q"]]]


def test_a_tree_takes_name_period_and_priority_from_observers_else_from_its_first_algorithm() -> None:
    made = plan(lab())

    settings = {tree.name: (tree.period_s, tree.priority) for tree in made.forest}

    assert settings == {"measure_distance": (1.0, 0), "find_in_view": (1.0, 0), "lid": (2.0, 5), "face": (1.0, 0)}


def test_trees_come_after_the_trees_that_they_need() -> None:
    made = plan(lab())

    assert [tree.name for tree in made.forest] == ["measure_distance", "find_in_view", "lid", "face"]


def test_a_variable_identified_with_a_needed_one_is_in_force_and_an_unreached_one_is_not() -> None:
    spec = checked_spec(
        [ShortAlgorithm(name="p", identifies=["a", "beside"]), ShortAlgorithm(name="q", identifies=["unwanted"])],
        skills=[skill("s", ["a"])],
    )

    made = plan(spec)

    assert made.in_force == ("a", "beside")
    assert [tree.name for tree in made.forest] == ["p"]


def test_an_unreached_variable_is_in_a_module_too() -> None:
    spec = checked_spec(
        [ShortAlgorithm(name="p", identifies=["a"]), ShortAlgorithm(name="q", identifies=["b"])],
        skills=[skill("s", ["a"])],
    )

    assert plan(spec).modules[0].variables == ("a", "b")


def test_without_skills_every_variable_that_has_an_algorithm_is_a_decision() -> None:
    assert plan(
        checked_spec([ShortAlgorithm(name="p", identifies=["a"]), ShortAlgorithm(name="q", identifies=["b"])])
    ).in_force == ("a", "b")


def test_values_that_an_algorithm_is_given_are_needed_like_preconditions() -> None:
    made = plan(checked_spec([ShortAlgorithm(name="p", identifies=["a"], needs=["x"], given=["pose"])]))

    assert made.forest[0].needs == ("x", "pose")
    assert set(made.in_force) == {"a", "x", "pose"}


def test_feedback_is_planned_and_drawn_as_feedback() -> None:
    looks_again = condition("not known(b) or age(b) > 10 s", "b", python="~known('b') | (age('b') > 10.0)")
    made = plan(
        checked_spec(
            [
                ShortAlgorithm(name="p", identifies=["a"], needs=[looks_again], feedback=["b"]),
                ShortAlgorithm(name="q", identifies=["b"], needs=["a"]),
            ]
        )
    )

    edges = {(edge.source.name, edge.target.name, edge.kind) for edge in made.edges}

    assert ("p", "b", EdgeKind.FEEDBACK) in edges
    assert ("q", "a", EdgeKind.REQUIRES) in edges
    assert [tree.name for tree in made.forest] == ["q", "p"]


def test_a_chain_of_ten_thousand_observers_is_planned() -> None:
    chain = [
        ShortAlgorithm(name=f"p{number}", identifies=[f"v{number}"], needs=[f"v{number + 1}"])
        for number in range(10_000)
    ]

    made = plan(checked_spec(chain, skills=[skill("s", ["v0"])]))

    assert len(made.forest) == 10_000
    assert (made.forest[0].name, made.forest[-1].name) == ("p9999", "p0")


def test_edges_read_as_sentences() -> None:
    made = plan(lab())

    assert Edge(Node(NodeKind.SKILL, "read"), Node(NodeKind.CONTEXT, "lamp_on"), EdgeKind.DECIDES_ON) in made.edges
    assert Edge(Node(NodeKind.OBSERVER, "lid"), Node(NodeKind.PERCEPTION, "feel_lid"), EdgeKind.RUNS) in made.edges
    assert [
        edge for edge in made.edges if edge.source.name == "measure_distance" and edge.kind is EdgeKind.REQUIRES
    ] == [
        Edge(
            Node(NodeKind.PERCEPTION, "measure_distance"),
            Node(NodeKind.CONTEXT, "robot_is_localized"),
            EdgeKind.REQUIRES,
        )
    ]


# Modules and names


def test_every_use_and_every_file_with_elements_has_a_module() -> None:
    use = Use(instance="centrifuge", template="tended_machine", place=place(27), template_place=place(27))
    made_by_use = replace(place(12, "specs/parts/machine.yaml"), use=use.place.span)
    made = plan(
        checked_spec(
            [ShortAlgorithm(name="p", identifies=["a"], needs=["x"], place=made_by_use)],
            variables=[variable("a", place=made_by_use)],
            uses=[use],
            origins={("perception", "p"): "centrifuge", ("context", "a"): "centrifuge"},
        )
    )

    centrifuge, lab_file = made.modules

    assert (centrifuge.name, centrifuge.use, centrifuge.files) == ("centrifuge", use, ())
    assert (centrifuge.variables, centrifuge.trees) == (("a",), ("p",))
    assert (lab_file.name, lab_file.use, lab_file.files) == ("lab", None, ("specs/lab.yaml",))
    assert lab_file.variables == ("x",)


@pytest.mark.parametrize(
    ("origin", "module"), [("lab", "lab"), ("PCR_cycler", "pcr_cycler"), ("Class", "class_"), ("start", "start_")]
)
def test_a_module_is_named_after_its_origin_unless_that_hides_a_name(origin: str, module: str) -> None:
    assert module_name(origin) == module


@given(st.lists(st.sampled_from(["value", "value_", "known", "Class", "print", "lid", "lid_", "MATH"]), unique=True))
def test_python_names_hide_no_name_and_are_unique(names: list[str]) -> None:
    made = [python_name(name.lower(), MODULE_NAMES) for name in names]

    assert len(set(made)) == len(names)
    assert not set(made) & (MODULE_NAMES | {"class", "print"})


def test_names_of_python_and_of_the_module_are_avoided() -> None:
    made = plan(
        checked_spec(
            [
                ShortAlgorithm(name="Value", identifies=["a"]),
                ShortAlgorithm(name="value_", identifies=["b"]),
                ShortAlgorithm(name="While", identifies=["c"]),
                ShortAlgorithm(name="VARIABLES", identifies=["d"]),
            ],
        )
    )

    assert [tree.function for tree in made.forest] == ["value_", "value__", "while_", "variables"]
    assert [tree.branches[0].constant for tree in made.forest] == ["VALUE", "VALUE_", "WHILE", "VARIABLES_"]


# The gate


def without_tree(made: BuildPlan) -> BuildPlan:
    return replace(made, forest=made.forest[1:])


def with_tree_twice(made: BuildPlan) -> BuildPlan:
    return replace(made, forest=(*made.forest, made.forest[0]))


def with_variable_forgotten(made: BuildPlan) -> BuildPlan:
    return replace(made, in_force=tuple(name for name in made.in_force if name != "near"))


def with_variable_made_up(made: BuildPlan) -> BuildPlan:
    return replace(made, in_force=(*made.in_force, "weather"))


def in_reverse(made: BuildPlan) -> BuildPlan:
    return replace(made, forest=made.forest[::-1])


def changed(made: BuildPlan, name: str, /, **fields: object) -> BuildPlan:
    forest = tuple(replace(tree, **fields) if tree.name == name else tree for tree in made.forest)  # type: ignore[arg-type]
    return replace(made, forest=forest)


def with_precondition_dropped(made: BuildPlan) -> BuildPlan:
    return changed(made, "lid", needs=("near",))


def with_alternatives_swapped(made: BuildPlan) -> BuildPlan:
    (group,) = tree_named(made, "lid").groups
    return changed(made, "lid", groups=(group[::-1],))


def with_alternative_dropped(made: BuildPlan) -> BuildPlan:
    (group,) = tree_named(made, "lid").groups
    return changed(made, "lid", groups=(group[:1],))


def with_name_made_up(made: BuildPlan) -> BuildPlan:
    return changed(made, "measure_distance", name="distance")


def joined_unasked(made: BuildPlan) -> BuildPlan:
    near, view, *rest = made.forest
    both = replace(
        near,
        groups=near.groups + view.groups,
        identifies=near.identifies + view.identifies,
        needs=tuple(dict.fromkeys(near.needs + view.needs)),
    )
    return replace(made, forest=(both, *rest))


def joined_under_other_conditions(made: BuildPlan) -> BuildPlan:
    first, (branch,) = tree_named(made, "face").groups
    guarded = replace(branch.algorithm, observable_when=made.checked.algorithms["feel_lid"].observable_when)
    return changed(made, "face", groups=(first, (replace(branch, algorithm=guarded),)))


def with_function_that_hides(made: BuildPlan) -> BuildPlan:
    return changed(made, "lid", function="value")


def with_functions_of_one_name(made: BuildPlan) -> BuildPlan:
    return changed(made, "lid", function="face")


def with_local_of_one_name(made: BuildPlan) -> BuildPlan:
    (group,) = tree_named(made, "lid").groups
    return changed(made, "lid", groups=(tuple(replace(branch, local_name="same") for branch in group),))


def with_class_that_hides(made: BuildPlan) -> BuildPlan:
    return replace(made, class_name="Reading")


def with_modules_emptied(made: BuildPlan) -> BuildPlan:
    return replace(made, modules=tuple(replace(module, trees=()) for module in made.modules))


def with_modules_alike(made: BuildPlan) -> BuildPlan:
    empty = replace(made.modules[0], name="LAB", variables=(), trees=(), skills=())
    return replace(made, modules=(*made.modules, empty))


def with_edge_dropped(made: BuildPlan) -> BuildPlan:
    return replace(made, edges=made.edges[1:])


def with_algorithm_of_another_spec(made: BuildPlan) -> BuildPlan:
    other = plan(lab())
    return changed(made, "measure_distance", groups=tree_named(other, "measure_distance").groups)


@pytest.mark.parametrize(
    ("spoil", "complaint"),
    [
        (without_tree, "near is in force, but its trees lack measure_distance"),
        (with_tree_twice, "tree measure_distance occurs twice"),
        (with_variable_forgotten, "near is needed but not in force"),
        (with_variable_made_up, "weather is not declared"),
        (in_reverse, "tree lid comes before measure_distance, which it needs"),
        (with_precondition_dropped, "tree lid has other preconditions than its algorithms"),
        (with_alternatives_swapped, "tree lid is not in order of rank"),
        (with_alternative_dropped, "open is in force, but its trees lack feel_lid"),
        (with_name_made_up, "tree distance has neither a name from `observers` nor that of its first algorithm"),
        (joined_unasked, "tree measure_distance joins algorithms"),
        (joined_under_other_conditions, "tree face joins algorithms"),
        (with_function_that_hides, "'value' is not a valid name for lab"),
        (with_functions_of_one_name, "name in lab face occurs twice"),
        (with_local_of_one_name, "name in lid same occurs twice"),
        (with_class_that_hides, "'Reading' is not a valid name for the package"),
        (with_modules_emptied, "modules hold the trees []"),
        (with_modules_alike, "module lab occurs twice"),
        (with_edge_dropped, "the dependency graph is not that of the forest"),
        (with_algorithm_of_another_spec, "measure_distance in tree measure_distance is not an algorithm of the spec"),
    ],
)
def test_the_gate_refuses_a_plan_that_is(spoil: Callable[[BuildPlan], BuildPlan], complaint: str) -> None:
    made = plan(lab())

    with pytest.raises(PlanError) as refused:
        verify(spoil(made), made.checked)

    assert complaint in str(refused.value)


def test_the_gate_refuses_elements_that_are_not_needed() -> None:
    spec = checked_spec(
        [ShortAlgorithm(name="p", identifies=["a"]), ShortAlgorithm(name="q", identifies=["b"])],
        skills=[skill("s", ["a"])],
    )
    everything = plan(
        checked_spec([ShortAlgorithm(name="p", identifies=["a"]), ShortAlgorithm(name="q", identifies=["b"])])
    )

    with pytest.raises(PlanError, match="b is in force but not needed"):
        verify(everything, spec)


def test_the_gate_refuses_a_variable_without_an_origin() -> None:
    spec = checked_spec([ShortAlgorithm(name="p", identifies=["a"], needs=["x"])], variables=[variable("x")])

    with pytest.raises(PlanError, match="x is in force, but no tree identifies it"):
        verify(plan(spec), spec)


def test_the_gate_lets_every_plan_of_algorithm_2_pass() -> None:
    made = plan(lab())

    verify(made, made.checked)
