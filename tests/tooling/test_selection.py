"""Selectors with the semantics of dbt, on a small graph, and against a naive oracle on random graphs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.tooling.selection import Choice, Choices, Edge, SelectorError, select

# one -> a -> look -> b -> deep -> c -> go;  a -> go;  eyes -> look, deep
EDGES: tuple[Edge, ...] = (
    ("lab/perception/one", "lab/context/a"),
    ("lab/context/a", "lab/perception/look"),
    ("lab/perception/look", "lab/context/b"),
    ("lab/context/b", "lab/perception/deep"),
    ("lab/perception/deep", "lab/context/c"),
    ("lab/context/c", "lab/skill/go"),
    ("lab/context/a", "lab/skill/go"),
    ("lab/observer/look", "lab/perception/look"),
    ("lab/observer/eyes", "lab/perception/deep"),
    ("shop/perception/one", "shop/context/a"),
)
LABELS = {"lab/context/c": "Lid-open"}
KINDS = ("context", "perception", "observer", "skill")


def choices(*edges: Edge) -> Choices:
    ids = dict.fromkeys(end for edge in edges for end in edge)
    nodes = []
    for node_id in ids:
        spec, kind, name = node_id.split("/")
        file, use = f"specs/{spec}.yaml", "rear" if name == "deep" else ""
        nodes.append(Choice(id=node_id, name=name, kind=kind, label=LABELS.get(node_id, name), file=file, use=use))
    return Choices(nodes=nodes, edges=edges, kinds=(*KINDS, "agent"), unneeded_names=frozenset({"unused"}))


def chosen(*wanted: str, without: tuple[str, ...] = ()) -> str:
    """Return the selected nodes; those of the lab without the name of their spec."""
    selected_ids = select(choices(*EDGES), wanted, without)
    return " ".join(sorted(node_id.removeprefix("lab/") for node_id in selected_ids))


ALL = (
    "context/a context/b context/c observer/eyes observer/look perception/deep perception/look perception/one"
    " shop/context/a shop/perception/one skill/go"
)


@pytest.mark.parametrize(
    ("selector", "expected"),
    [
        ("b", "context/b"),
        ("lab/context/b", "context/b"),
        ("look", "observer/look perception/look"),
        ("a", "context/a shop/context/a"),
        ("lab/context/a", "context/a"),
        ("+b", "context/a context/b observer/look perception/look perception/one shop/none"),
        ("1+b", "context/b perception/look"),
        ("2+b", "context/a context/b observer/look perception/look"),
        ("0+b", "context/b"),
        ("b+", "context/b context/c perception/deep skill/go"),
        ("b+0", "context/b"),
        ("b+1", "context/b perception/deep"),
        ("b+2", "context/b context/c perception/deep"),
        ("1+b+1", "context/b perception/deep perception/look"),
        ("+c+", ALL),
        ("1+lab/context/a+1", "context/a perception/look perception/one skill/go"),
        ("@look", ALL),
        ("@shop/context/a", "shop/context/a shop/perception/one"),
        ("b c", "context/b context/c"),
        ("  b   c  ", "context/b context/c"),
        ("+b,c+", ""),
        ("lab/context/a+,+b", "context/a context/b perception/look"),
        ("kind:observer", "observer/eyes observer/look"),
        ("kind:agent", ""),
        ("kind:observer,look", "observer/look"),
        ("kind:context,shop/*", "shop/context/a"),
        ("1+kind:skill", "context/a context/c skill/go"),
        ("kind:o*,lab/*", "observer/eyes observer/look"),
        ("use:rear", "perception/deep"),
        ("use:rear+1", "context/c perception/deep"),
        ("file:specs/shop.yaml", "shop/context/a shop/perception/one"),
        ("file:*/shop.yaml,kind:context", "shop/context/a"),
        ("lo*", "observer/look perception/look"),
        ("[ab]", "context/a context/b shop/context/a"),
        ("?", "context/a context/b context/c shop/context/a"),
        ("lab/*/e*", "observer/eyes"),
        ("b+999999999999999999999999", "context/b context/c perception/deep skill/go"),
        ("b c,kind:context", "context/b context/c"),
    ],
)
def test_a_selector_has_the_semantics_of_dbt(selector: str, expected: str) -> None:
    wanted = {name for name in expected.split() if name != "shop/none"}
    if expected == ALL and selector in ("+c+", "@look"):
        wanted -= {"shop/context/a", "shop/perception/one"}

    assert set(chosen(selector).split()) == wanted


@pytest.mark.parametrize(
    ("wanted", "without", "expected"),
    [
        ((), (), ALL),
        (("b", "c"), (), "context/b context/c"),
        (("b", "kind:skill"), (), "context/b skill/go"),
        ((), ("kind:perception kind:observer", "shop/*"), "context/a context/b context/c skill/go"),
        (("+b",), ("1+b",), "context/a observer/look perception/one"),
        (("+b",), ("kind:context,b", "look"), "context/a perception/one"),
        (("b",), ("b",), ""),
    ],
)
def test_options_add_up_and_exclusions_are_removed(
    wanted: tuple[str, ...], without: tuple[str, ...], expected: str
) -> None:
    assert chosen(*wanted, without=without) == expected


@pytest.mark.parametrize(
    ("selector", "message", "marked"),
    [
        ("", "the selector is empty", ""),
        ("   ", "the selector is empty", " "),
        ("b,", "a name is missing; a selector has no blanks around '+' and ','", ""),
        (",b", "a name is missing; a selector has no blanks around '+' and ','", ","),
        ("b, c", "a name is missing; a selector has no blanks around '+' and ','", " "),
        ("b + c", "a name is missing; a selector has no blanks around '+' and ','", " "),
        ("+", "a name is missing; a selector has no blanks around '+' and ','", ""),
        ("2+", "a name is missing; a selector has no blanks around '+' and ','", ""),
        ("@", "a name is missing; a selector has no blanks around '+' and ','", ""),
        ("kind:", "a name is missing; a selector has no blanks around '+' and ','", ""),
        ("b ++c", "a name is missing; a selector has no blanks around '+' and ','", "+"),
        ("b +c++", "'+' is not allowed here", "+"),
        ("b+1+", "'+' is not allowed here", "+"),
        ("b+c", "'c' is not allowed here", "c"),
        ("b@", "'@' is not allowed here", "@"),
        ("kind:kind:b", "':' is not allowed here", ":"),
        ("@b+", "'@' already goes both ways: leave out the '+'", "+"),
        ("@2+b", "'@' already goes both ways: leave out the '+'", "2"),
        ("kind:observr", "there is no kind 'observr': did you mean 'observer'?", "observr"),
        ("kind:banana", "there is no kind 'banana': choose from context, perception, observer, skill, agent", "banana"),
        ("b knd:observer", "there is no method 'knd': did you mean 'kind'?", "knd"),
        ("tag:x", "there is no method 'tag': choose from kind, file, use", "tag"),
        (":x", "there is no method '': choose from kind, file, use", ":"),
        ("b 2+loook", "no node matches 'loook' (did you mean 'look'?)", "loook"),
        ("lab/context/bb", "no node matches 'lab/context/bb' (did you mean 'lab/context/b'?)", "lab/context/bb"),
        ("entirely_else", "no node matches 'entirely_else'", "entirely_else"),
        ("Lid-open", "no node matches 'Lid-open': that is the label of 'c'", "Lid-open"),
        ("unused", "no node matches 'unused' in the graph: it is declared, but no decision needs it", "unused"),
        ("x*", "no node matches 'x*'", "x*"),
        ("use:front", "no node matches 'front'", "front"),
        ("a 1+use:raer", "no node matches 'raer' (did you mean 'rear'?)", "raer"),
    ],
)
def test_an_error_is_reported_with_its_place(selector: str, message: str, marked: str) -> None:
    with pytest.raises(SelectorError) as error:
        select(choices(*EDGES), ["b", selector] if selector != "2+" else [selector])

    first, shown, marks = str(error.value).split("\n")
    assert first == f"{message} (column {error.value.column})"
    assert shown[2:] == selector
    assert shown[marks.index("^") : len(marks)] == marked


def test_excluded_nodes_must_exist_too() -> None:
    with pytest.raises(SelectorError, match="no node matches 'loook'"):
        select(choices(*EDGES), ["b"], ["loook"])


def test_unprintable_characters_do_not_reach_the_terminal() -> None:
    with pytest.raises(SelectorError) as error:
        select(choices(*EDGES), ["b \x1b[31mred"])

    assert "\x1b" not in str(error.value)


# Against an oracle

NAMES = tuple("abcdefg")
NODE_IDS = st.sampled_from([f"lab/{kind}/{name}" for kind, name in product(KINDS[:2], NAMES)])
GRAPHS = st.lists(st.tuples(NODE_IDS, NODE_IDS), min_size=1, max_size=14, unique=True)
STEPS = st.sampled_from(["", "0", "1", "2", "3"])
PATTERNS = st.one_of(st.sampled_from(NAMES), st.sampled_from(["[a-c]", "*", "kind:context", "lab/context/*"]))
TERMS = st.one_of(
    st.builds("{}+{}".format, STEPS, PATTERNS),
    st.builds("{}+{}".format, PATTERNS, STEPS),
    st.builds("{}+{}+{}".format, STEPS, PATTERNS, STEPS),
    st.builds("@{}".format, PATTERNS),
    PATTERNS,
)
SELECTORS = st.lists(st.lists(TERMS, min_size=1, max_size=3), min_size=1, max_size=3)


def oracle(edges: list[Edge], parts: list[list[str]]) -> set[str]:
    """Evaluate a selector naively: walk every path, step by step."""
    ids = {end for edge in edges for end in edge}

    def reachable_ids(start: set[str], steps: str, forward: bool) -> set[str]:
        reached_ids = set(start)
        for _ in range(int(steps) if steps else len(ids)):
            reached_ids |= (
                {user for need, user in edges if need in reached_ids}
                if forward
                else {need for need, user in edges if user in reached_ids}
            )
        return reached_ids

    def match_pattern(pattern: str) -> set[str]:
        if pattern in ("kind:context", "lab/context/*"):
            return {node_id for node_id in ids if "/context/" in node_id}
        allowed = {"[a-c]": "abc", "*": NAMES}.get(pattern, (pattern,))
        return {node_id for node_id in ids if node_id[-1] in allowed}

    def match_term(term: str) -> set[str]:
        if term.startswith("@"):
            return reachable_ids(reachable_ids(match_pattern(term[1:]), "", True), "", False)
        before, after, pattern = None, None, term
        if "+" in pattern and pattern.split("+")[0] in ("", "0", "1", "2", "3"):
            before, pattern = pattern.split("+", 1)
        if "+" in pattern:
            pattern, after = pattern.split("+")
        start = match_pattern(pattern)
        selected = set(start)
        selected |= reachable_ids(start, before, False) if before is not None else set()
        return selected | (reachable_ids(start, after, True) if after is not None else set())

    return {node_id for part in parts for node_id in set.intersection(*map(match_term, part))}


def answer(edges: Sequence[Edge], text: str) -> frozenset[str] | SelectorError:
    try:
        return select(choices(*edges), [text])
    except SelectorError as error:
        return error


@given(GRAPHS, SELECTORS)
def test_selectors_agree_with_the_naive_oracle(edges: list[Edge], parts: list[list[str]]) -> None:
    selected = answer(edges, " ".join(",".join(terms) for terms in parts))

    assert selected == oracle(edges, parts) or (isinstance(selected, SelectorError) and "no node" in str(selected))


@given(GRAPHS, SELECTORS)
def test_only_names_without_a_node_are_errors(edges: list[Edge], parts: list[list[str]]) -> None:
    names = {end[-1] for edge in edges for end in edge}
    used = {letter for terms in parts for term in terms for letter in term.split("+") if letter in NAMES}
    used |= {term[1:] for terms in parts for term in terms if term.startswith("@") and term[1:] in NAMES}
    globs = any(pattern in term for terms in parts for term in terms for pattern in ("[a-c]", "lab/context/*"))

    selected = answer(edges, " ".join(",".join(terms) for terms in parts))

    assert isinstance(selected, SelectorError) == (not used <= names) or globs


@given(st.text(alphabet="ab+@,: 2*[]/kind", max_size=12))
def test_any_text_is_a_selector_or_has_an_error_within_it(text: str) -> None:
    selected = answer(EDGES, text)

    if isinstance(selected, SelectorError):
        assert 1 <= selected.column <= len(text) + 1
    else:
        assert selected <= {end for edge in EDGES for end in edge}


KNOWN_NAMES = st.sampled_from(["a", "b", "c", "one", "look", "deep", "go", "lab/context/*", "kind:perception"])
KNOWN_TERMS = st.lists(
    st.one_of(
        KNOWN_NAMES,
        st.builds("{}+{}".format, STEPS, KNOWN_NAMES),
        st.builds("{}+{}".format, KNOWN_NAMES, STEPS),
        st.builds("@{}".format, KNOWN_NAMES),
    ),
    min_size=1,
    max_size=5,
)


@given(KNOWN_TERMS, st.integers(0, 5))
def test_one_unknown_name_among_known_ones_is_an_error_at_its_column(terms: list[str], index: int) -> None:
    selected = answer(EDGES, " ".join(terms))
    wrong_text = " ".join([*terms[:index], "nobody", *terms[index:]])
    error = answer(EDGES, wrong_text)

    assert isinstance(selected, frozenset)
    assert selected
    assert selected <= {end for edge in EDGES for end in edge}
    assert isinstance(error, SelectorError)
    assert error.column == wrong_text.index("nobody") + 1


def test_a_chain_of_a_hundred_thousand_is_followed_completely() -> None:
    chain = [(f"lab/context/v{number}", f"lab/context/v{number + 1}") for number in range(100_000)]

    assert len(select(choices(*chain), ["v0+"])) == 100_001
