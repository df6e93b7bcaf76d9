"""Names in Python for the elements of a spec. They are the same on every version of Python, and no name hides another.

An identifier of the language starts with a letter, and differs by more than case from all other identifiers of its
kind. The names of functions and branches are in lower case, and the names of constants in upper case, so that these
names never collide.
"""

from __future__ import annotations

from codra_dsl.language.check.index.spec_index import MAIN_EXECUTION
from codra_dsl.language.model import Spec

CONDITION_WORDS = frozenset(
    {"age", "between", "choose", "confirmed", "first_known", "first_of"}
    | {"known", "literal", "maximum", "minimum", "value"}
)
"""The functions of the runtime that conditions in generated code call."""

POSE_FUNCTIONS = frozenset({"distance", "in_view"})
"""The functions of the runtime that conditions over poses call as well."""

MODULE_NAMES = frozenset(
    {"VARIABLES", "OBSERVERS", "SKILLS", "math", "observer", "perception"}
    | {"Behaviour", "FailureIsSuccess", "Parallel", "ParallelPolicy", "Selector", "Sequence"}
    | {"Accept", "ControlFlag", "DueOrRunning", "Identify", "Perceive", "Precondition"}
    | {"Algorithm", "ExpectationModel", "Observer", "ObserverModel", "PreviewCondition", "SkillModel"}
    | {"TopicModel", "VariableModel"}
    | {"boolean", "integer", "member", "real", "text"}
    | CONDITION_WORDS
    | POSE_FUNCTIONS
)
"""The names that generated modules import or define themselves."""

ENTRY_NAMES = frozenset(
    {"MODEL", "start", "VariableName", "SkillName", "BoolName", "IntName", "FloatName", "StrName"}
    | {"BoolAnswer", "IntAnswer", "FloatAnswer", "StrAnswer"}
    | {"TYPE_CHECKING", "Any", "Callable", "Literal", "Mapping", "Never", "TypeVar", "math", "overload"}
    | {"Clock", "ContextManager", "ContextModel", "HandleModel", "Reading", "EventLog", "ResourceModel"}
)
"""The names that the entry of a generated package imports or defines itself, apart from its modules."""

KNOWLEDGE_MODULE = "knowledge"
"""The module of a spec's knowledge and agents."""

MAPE_MODULE = "mape"
"""The module of a spec's loops."""

METRIC_ENGINE, ACTION_ENGINE = "metric_engine", "action_engine"
"""The modules of the two fuzzy engines of loops."""


# The words are written out, because Python's own lists grow from version to version, and `site` adds names to them.
_PYTHON_NAMES_TEXT = """
    False None True and as assert async await break class continue def del elif else except finally for from global if
    import in is lambda nonlocal not or pass raise return try while with yield case match type
    abs aiter all anext any ascii bin bool breakpoint bytearray bytes callable chr classmethod compile complex copyright
    credits delattr dict dir divmod enumerate eval exec exit filter float format frozenset getattr globals hasattr hash
    help hex id input int isinstance issubclass iter len license list locals map max memoryview min next object oct open
    ord pow print property quit range repr reversed round set setattr slice sorted staticmethod str sum super tuple vars
    zip
"""
_PYTHON_NAMES = frozenset(_PYTHON_NAMES_TEXT.split())


def python_name(text: str, taken_names: frozenset[str]) -> str:
    """Return an identifier of the language as a name in Python that is not a keyword, a builtin, or in `taken_names`.

    A keyword, builtin or taken name gets an underscore at its end. If a name is such a name followed by underscores, it
    gets one more underscore, so that different names stay different.
    """
    stem = text.rstrip("_")
    return f"{text}_" if stem in taken_names or stem in _PYTHON_NAMES else text


def module_name(origin: str, taken_names: frozenset[str] = ENTRY_NAMES) -> str:
    """Return the Python name of the module for an origin, the identifier that `load` gives to a source of elements."""
    return python_name(origin.lower(), taken_names)


def class_name(name: str) -> str:
    """Return the Python name of the class of a spec's context, e.g. `PcrLab` for `pcr_lab`.

    Programs write this name, so it is never changed to avoid a name in use: see `taken_class_name`.
    """
    return camel_case(name)


def taken_class_name(spec: Spec) -> str | None:
    """Return the name of the class of a spec's context if its package uses this name for something else."""
    name = class_name(spec.name)
    return name if name in entry_names(spec) or name in _PYTHON_NAMES else None


def knowledge_class(name: str) -> str:
    """Return the Python name of the class of a spec's graph."""
    return f"{class_name(name)}Knowledge"


def handle_class(agent: str) -> str:
    """Return the Python name of the class of an agent's handle, if no other agent's handle has this name."""
    return f"{camel_case(agent)}Handle"


def entry_names(spec: Spec) -> frozenset[str]:
    """Return the names that the entry of a spec's package uses itself; knowledge and loops add names to these."""
    taken_names = ENTRY_NAMES
    if spec.knows:
        taken_names |= {KNOWLEDGE_MODULE, "KNOWLEDGE", knowledge_class(spec.name), "Agent", "AgentHandle"}
        taken_names |= {handle_class(agent) for agent in (*(agent.name for agent in spec.agents), MAIN_EXECUTION)}
    if spec.adapts:
        taken_names |= {MAPE_MODULE, "MAPE", "Mape", "Leaves", "loops", METRIC_ENGINE, ACTION_ENGINE}
        taken_names |= {tree_module_name(tree.name) for tree in spec.trees}
    return taken_names


def tree_module_name(name: str) -> str:
    """Return the Python name of the module of a behaviour tree.

    The name never ends with an underscore, because `python_name` adds underscores to avoid it: underscores at the end
    of the tree's name are moved to its beginning.
    """
    stem = name.lower().rstrip("_")
    return f"tree{'_' * (1 + len(name) - len(stem))}{stem}"


def camel_case(name: str) -> str:
    """Return an identifier of the language in the style of Python's class names."""
    return "".join(part[:1].upper() + part[1:] for part in name.split("_"))
