"""Texts for the constructs that BehaviorTree.CPP's documentation describes; written for these tests.

`BODIES` are bodies of the tree `Main` without any finding, in a file that declares `MODELS` and the tree `Part`.
`FILES` are complete files with the rules of their findings, all of which are warnings. `REFUSED` are texts with the
rule of their error and the construct that its message names.
"""

from __future__ import annotations

_ACT = '<Action ID="Act"><input_port name="x" default="0"/><inout_port name="y" default="{y}"/></Action>'
MODELS = f"""{_ACT}<Action ID="Say"><input_port name="message" default="hello"/></Action>
<Action ID="Find"><output_port name="pose" default="{{pose}}"/></Action>
<Action ID="Grip"><input_port name="force" type="double" default="1.5"/>
  <input_port name="fingers" type="int" default="2"/><input_port name="soft" type="bool" default="true"/></Action>
<Condition ID="Near"><input_port name="pose" default="{{pose}}"/></Condition><Condition ID="Open"/>
<Control ID="Race"/><Decorator ID="Every"><input_port name="s" default="1"/></Decorator>"""
PART = '<BehaviorTree ID="Part"><Sequence><Act x="{p}" y="{q}"/><Say message="{text}"/></Sequence></BehaviorTree>'

_CONTROL_BODIES = {
    "all built-in sequences": "<Sequence><SequenceWithMemory><Open/></SequenceWithMemory><AsyncSequence><Open/>"
    "</AsyncSequence><ReactiveSequence><Open/><Act/></ReactiveSequence></Sequence>",
    "all built-in fallbacks": "<Fallback><ReactiveFallback><Open/><Act/></ReactiveFallback><AsyncFallback><Act/>"
    "</AsyncFallback></Fallback>",
    "an explicit sequence": '<Control ID="Sequence" name="steps"><Action ID="Act" x="1"/><Condition ID="Open"/>'
    "</Control>",
    "explicit tags for all kinds": '<Control ID="Fallback"><Decorator ID="Inverter"><Condition ID="Near"/></Decorator>'
    '<SubTree ID="Part" p="1" q="{q}" text="t"/></Control>',
    "a parallel with defaults": "<Parallel><Act/><Say/></Parallel>",
    "a parallel for two of three": '<Parallel success_count="2" failure_count="2"><Act/><Say/><Open/></Parallel>',
    "a parallel that needs all": '<Parallel success_count="-1" failure_count="-1"><Act/><Say/></Parallel>',
    "a parallel with counts from entries": '<Parallel success_count="{n}" failure_count="{m}"><Act/><Say/></Parallel>',
    "a parallel that ends when all end": '<ParallelAll max_failures="2"><Act/><Say/><Open/></ParallelAll>',
    "a choice without else": "<IfThenElse><Open/><Act/></IfThenElse>",
    "a choice with else": "<IfThenElse><Open/><Act/><Say/></IfThenElse>",
    "a reactive choice": '<WhileDoElse><Near pose="{pose}"/><Act/><Say/></WhileDoElse>',
    "a reactive choice without else": "<WhileDoElse><Open/><Act/></WhileDoElse>",
    "a switch over texts": '<Switch2 variable="{door}" case_1="open" case_2="shut"><Act/><Say/><Open/></Switch2>',
    "a switch over numbers": '<Switch3 variable="{n}" case_1="1" case_2="42" case_3="666"><Act/><Say/><Open/><Find/>'
    "</Switch3>",
    "a switch with six cases": '<Switch6 variable="{n}" case_1="a" case_2="b" case_3="c" case_4="d" case_5="e" '
    'case_6="f">' + "<Act/>" * 7 + "</Switch6>",
    "a switch in a switch": '<Switch2 variable="{a}" case_1="1" case_2="2"><Switch2 variable="{b}" case_1="1" '
    'case_2="2"><Act/><Say/><Open/></Switch2><Say/><Open/></Switch2>',
    "one child": "<Sequence><Act/></Sequence>",
    "a leaf alone": "<Act/>",
    "a condition alone": "<Near/>",
    "ten levels": "<Sequence>" * 10 + "<Act/>" + "</Sequence>" * 10,
    "forty children": "<Sequence>" + "<Act/>" * 40 + "</Sequence>",
    "an own control node in a built-in one": "<ReactiveFallback><Open/><Race><Act/><Say/></Race></ReactiveFallback>",
    "built-in nodes in an own control node": "<Race><Sequence><Act/></Sequence><AlwaysFailure/></Race>",
    "both constants": "<Fallback><AlwaysFailure/><AlwaysSuccess/></Fallback>",
    "names on every level": '<Fallback name="a"><Sequence name="b"><Act name="c"/></Sequence></Fallback>',
    "the same name twice": '<Sequence><Act name="a"/><Act name="a"/></Sequence>',
    "guards in a reactive sequence": '<ReactiveSequence><Open/><Inverter><Near/></Inverter><Act x="{x}"/>'
    "</ReactiveSequence>",
}

_DECORATOR_BODIES = {
    "an inverter": "<Inverter><Open/></Inverter>",
    "a forced success": "<ForceSuccess><Act/></ForceSuccess>",
    "a forced failure": "<ForceFailure><Act/></ForceFailure>",
    "a repetition": '<Repeat num_cycles="3"><Act/></Repeat>',
    "an endless repetition": '<Repeat num_cycles="-1"><Act/></Repeat>',
    "a repetition from an entry": '<Repeat num_cycles="{n}"><Act/></Repeat>',
    "retries": '<RetryUntilSuccessful num_attempts="5"><Open/></RetryUntilSuccessful>',
    "endless retries": '<RetryUntilSuccessful num_attempts="-1"><Act/></RetryUntilSuccessful>',
    "running until failure": "<KeepRunningUntilFailure><Open/></KeepRunningUntilFailure>",
    "a delay": '<Delay delay_msec="500"><Act/></Delay>',
    "a time limit": '<Timeout msec="1500"><Act/></Timeout>',
    "a time limit from an entry": '<Timeout msec="{limit}"><Act/></Timeout>',
    "run once": "<RunOnce><Act/></RunOnce>",
    "run once, then its result again": '<RunOnce then_skip="false"><Act/></RunOnce>',
    "a precondition": '<Precondition if="n == 1" else="RUNNING"><Act/></Precondition>',
    "a precondition with a default": '<Precondition if="ready"><Act/></Precondition>',
    "skipped until an update": '<SkipUnlessUpdated entry="{goal}"><Act/></SkipUnlessUpdated>',
    "waiting for an update": '<WaitValueUpdate entry="{goal}"><Act/></WaitValueUpdate>',
    "an update as a condition": '<Fallback><WasEntryUpdated entry="{goal}"/><Act/></Fallback>',
    "a loop over whole numbers": '<LoopInt queue="1;2;3" value="{n}"><Act x="{n}"/></LoopInt>',
    "a loop over numbers": '<LoopDouble queue="0.5;1.5" value="{d}"><Grip force="{d}"/></LoopDouble>',
    "a loop over texts": '<LoopString queue="left;right" value="{side}" if_empty="FAILURE"><Say message="{side}"/>'
    "</LoopString>",
    "a loop over truth values": '<LoopBool queue="true;false" value="{b}"><Act x="{b}"/></LoopBool>',
    "a loop over an entry": '<LoopString queue="{names}" value="{name}"><Say message="{name}"/></LoopString>',
    "an own decorator": '<Every s="2.5"><Act/></Every>',
    "decorators in decorators": '<Timeout msec="100"><Inverter><ForceSuccess><Act/></ForceSuccess></Inverter>'
    "</Timeout>",
    "a decorated subtree": '<Repeat num_cycles="2"><SubTree ID="Part" p="1" q="{q}" text="a"/></Repeat>',
    "an explicit decorator": '<Decorator ID="Delay" delay_msec="10"><Act/></Decorator>',
    "a sleep": '<Sleep msec="20"/>',
    "a sleep from an entry": '<Sleep name="pause" msec="{pause}"/>',
}

_SCRIPTS = (
    *("a := 1", "a = 1", "a := 1.5", "a := -3", "a := .5", "a := 1e3", "a := 2.5e-3", "a := 0xFF", "a := true"),
    *("a := false", "a := 'text'", "a := ''", "a := b", "a := b + c", "a := b - 1", "a := b * 2 / c", "a := -b"),
    *("a := (b + 1) * 2", "a += 1", "a -= 1", "a *= 2", "a /= 2", "a := 1; b := 2", "a := 1; b := a;", " a:=1 "),
    *("a := b == 1", "a := b != 'x'", "a := b &gt; 1 &amp;&amp; c &lt; 2", "a := !b", "a := !(b || c)"),
    *("a := b ? 1 : 2", "a := b &gt; 0 ? 'up' : 'down'", "a := b ? c ? 1 : 2 : 3", "a := 1 &lt;= b", "a := b &gt;= 1"),
    *("a := 1;\n      b := 2;\n      c := 3", "@a := 1", "a := @b", "a := 'x y; z'", "a_1 := A2", "a := 5; a = a + 1"),
)
_CONDITIONS = (
    *("a", "!a", "a == 1", "a != 1", "a == 'x'", "a &gt; 1.5", "a &gt;= -1", "a &lt; b", "a &amp;&amp; b", "a || b"),
    *("(a || b) &amp;&amp; c", "a == true", "a + 1 &gt; b * 2", "true", "a ? b : c", "@battery &lt; 20"),
)

_PORT_BODIES = {
    "a text": '<Say message="good morning"/>',
    "an empty text": '<Say message=""/>',
    "an entry": '<Say message="{text}"/>',
    "an entry of the root": '<Say message="{@text}"/>',
    "the entry of the same name": '<Say message="{=}"/>',
    "an entry with blanks around it": '<Say message=" {text} "/>',
    "an entry with a dot": '<Say message="{arm.state}"/>',
    "a pose as text": '<Act x="1.0;2.5;3.14"/>',
    "JSON": """<Act x='{"json":1}x'/>""",
    "JSON with prefix": """<Act x='json:{"x":1,"y":[1,2]}'/>""",
    "numbers of every type": '<Grip force="-1.5e2" fingers="0" soft="0"/>',
    "entries for numbers": '<Grip force="{f}" fingers="{n}" soft="{s}"/>',
    "an output": '<Find pose="{place}"/>',
    "an output to the entry of the same name": '<Find pose="="/>',
    "an inout port": '<Act y="{counter}"/>',
    "all defaults": "<Sequence><Act/><Say/><Find/><Grip/><Near/></Sequence>",
    "data from node to node": '<Sequence><Find pose="{place}"/><Near pose="{place}"/><Act x="{place}"/></Sequence>',
    "letters of many alphabets": '<Say message="Grüße, 你好, здравствуй"/>',
    "escaped letters": '<Say message="&lt;b&gt; &amp; &quot;c&quot; &apos;d&apos; &#65;"/>',
    "single quotes": "<Say message='it is \"on\"'/>",
    "a path of a file": '<Say message="/opt/robot/map.yaml"/>',
    "an address": '<Say message="tcp://10.0.0.1:5555?x=1"/>',
    "a pattern": '<Say message="^[a-z]+$|\\d{2}"/>',
    "set an entry to a text": '<SetBlackboard value="on" output_key="lamp"/>',
    "set an entry to a number": '<SetBlackboard value="42" output_key="answer"/>',
    "copy an entry": '<SetBlackboard value="{a}" output_key="b"/>',
    "set an entry of the root": '<SetBlackboard value="1" output_key="@shared"/>',
    "remove an entry": '<UnsetBlackboard key="lamp"/>',
}

_SUBTREE_BODIES = {
    "texts and entries": '<SubTree ID="Part" p="1" q="{q}" text="hello"/>',
    "a name": '<SubTree ID="Part" name="first" p="{a}" q="{b}" text="{c}"/>',
    "automatic remapping": '<SubTree ID="Part" _autoremap="true"/>',
    "automatic remapping and one port": '<SubTree ID="Part" p="7" _autoremap="1"/>',
    "no automatic remapping": '<SubTree ID="Part" p="7" q="{q}" text="t" _autoremap="false"/>',
    "the same subtree twice": '<Sequence><SubTree ID="Part" p="1" q="{a}" text="a"/>'
    '<SubTree ID="Part" p="2" q="{b}" text="b"/></Sequence>',
    "conditions of a subtree": '<SubTree ID="Part" p="1" q="{q}" text="t" _skipIf="done" _onSuccess="done := true"/>',
    "a subtree in a fallback": '<Fallback><Open/><SubTree ID="Part" p="{=}" q="{=}" text="{=}"/></Fallback>',
    "a subtree that editors collapse": '<SubTree ID="Part" p="1" q="{q}" text="t" _collapsed="true" _uid="4"/>',
}


def _quoted(text: str) -> str:
    return f'"{text}"'


BODIES: dict[str, str] = {
    **_CONTROL_BODIES,
    **_DECORATOR_BODIES,
    **_PORT_BODIES,
    **_SUBTREE_BODIES,
    **{f"the script {script!r}": f"<Script code={_quoted(script)}/>" for script in _SCRIPTS},
    **{f"the condition {text!r}": f"<ScriptCondition code={_quoted(text)}/>" for text in _CONDITIONS},
    **{
        f"the attribute {name}": f'<Sequence {name}="{text}"><Act {name}="{text}"/></Sequence>'
        for name, text in (
            *(("_failureIf", "a == 1"), ("_successIf", "b"), ("_skipIf", "!c"), ("_while", "d &lt; 5")),
            *(("_onSuccess", "a := 1"), ("_onFailure", "a := 2; b := 3"), ("_onHalted", "a = 4"), ("_post", "a += 1")),
        )
    },
    "all attributes at once": '<Act _failureIf="a" _successIf="b" _skipIf="c" _while="d" _onSuccess="e := 1" '
    '_onFailure="e := 2" _onHalted="e := 3" _post="e := 4"/>',
}


def documented_file(body: str) -> str:
    """Return a file with a body of the tree `Main`."""
    main = f'<BehaviorTree ID="Main">{body}</BehaviorTree>'
    return f'<root BTCPP_format="4">{main}{PART}<TreeNodesModel>{MODELS}</TreeNodesModel></root>'


def _file(*parts: str, attributes: str = ' BTCPP_format="4"') -> str:
    return f"<root{attributes}>{''.join(parts)}</root>"


def _tree(id_: str, body: str) -> str:
    return f'<BehaviorTree ID="{id_}">{body}</BehaviorTree>'


def _models(*models: str) -> str:
    return f"<TreeNodesModel>{''.join(models)}</TreeNodesModel>"


_OLD = ' BTCPP_format="3"'
_DONE = "<AlwaysSuccess/>"
_OTHER = _tree("Other", '<Act x="{target}"/>')
_WITH_ACT = _models(_ACT)

FILES: dict[str, tuple[str, list[str]]] = {
    # Several trees
    "a main tree": (
        _file(_tree("A", _DONE), _tree("B", _DONE), attributes=' BTCPP_format="4" main_tree_to_execute="B"'),
        [],
    ),
    "a tree that nothing uses": (_file(_tree("A", _DONE), _OTHER, _WITH_ACT), []),
    "three levels of subtrees": (
        _file(_tree("A", '<SubTree ID="B"/>'), _tree("B", '<SubTree ID="C"/>'), _tree("C", _DONE)),
        [],
    ),
    "two trees that share a subtree": (
        _file(_tree("A", '<SubTree ID="C"/>'), _tree("B", '<SubTree ID="C"/>'), _tree("C", _DONE)),
        [],
    ),
    "models before the trees": (_file(_WITH_ACT, _tree("A", "<Act/>")), []),
    "two lists of models": (_file(_WITH_ACT, _tree("A", "<Act/>"), _models('<Condition ID="Open"/>')), []),
    "an empty list of models": (_file(_tree("A", _DONE), "<TreeNodesModel/>"), []),
    "described trees": (_file('<BehaviorTree ID="A" _description="does it"><AlwaysSuccess/></BehaviorTree>'), []),
    "a project of Groot": (_file(_tree("A", _DONE), attributes=' BTCPP_format="4" project_name="robot"'), []),
    # Models
    "a model of each kind": (
        _file(
            _tree("A", _DONE),
            _models('<Action ID="A1"/>', '<Condition ID="C1"/>', '<Control ID="D1"/>', '<Decorator ID="E1"/>'),
        ),
        [],
    ),
    "types of ports": (
        _file(
            _tree("A", '<Move speed="1.5" tries="3" fast="true" to="{goal}"/>'),
            _models(
                '<Action ID="Move"><input_port name="speed" type="double"/><input_port name="tries" type="unsigned"/>'
                '<input_port name="fast" type="bool"/><input_port name="to" type="geometry::Pose"/></Action>'
            ),
        ),
        [],
    ),
    "defaults of ports": (
        _file(
            _tree("A", "<Move/>"),
            _models(
                '<Action ID="Move"><input_port name="v" default="1"/><input_port name="w" default="{w}"/></Action>'
            ),
        ),
        [],
    ),
    "a port with a description as text": (
        _file(
            _tree("A", '<Move v="1"/>'),
            _models('<Action ID="Move"><input_port name="v">speed in m/s</input_port></Action>'),
        ),
        [],
    ),
    "a port with a description as attribute": (
        _file(
            _tree("A", '<Move v="1"/>'),
            _models('<Action ID="Move"><input_port name="v" type="double" description="speed"/></Action>'),
        ),
        [],
    ),
    "a model of a subtree with defaults": (
        _file(
            _tree("A", '<SubTree ID="Other"/>'),
            _OTHER,
            _models(_ACT, '<SubTree ID="Other"><input_port name="target" default="dock"/></SubTree>'),
        ),
        [],
    ),
    "a model of a subtree with an output": (
        _file(
            _tree("A", '<SubTree ID="Other" result="{r}"/>'),
            _tree("Other", "<Script code=\"result := 'ok'\"/>"),
            _models('<SubTree ID="Other"><output_port name="result"/></SubTree>'),
        ),
        [],
    ),
    "an editable model": (_file(_tree("A", "<Move/>"), _models('<Action ID="Move" editable="true"/>')), []),
    # Layout
    "line breaks of Windows": (_file("\r\n  ", _tree("A", _DONE), "\r\n"), []),
    "tabs": (_file("\n\t", _tree("A", "\n\t\t" + _DONE), "\n"), []),
    "attributes on several lines": (_file(_tree("A", '<Sleep\n      name="a"\n      msec="1"\n    />')), []),
    "comments everywhere": (
        "<!-- a -->"
        + _file("<!-- b -->", _tree("A", f"<!-- c --><Sequence><!-- d -->{_DONE}<!-- e --></Sequence>"))
        + "<!-- f -->",
        [],
    ),
    "comments with letters of XML": (_file("<!-- a < b && c > d -->", _tree("A", _DONE)), []),
    "a declaration in other letters": (f'<?xml version="1.0" encoding="utf-8"?>{_file(_tree("A", _DONE))}', []),
    "a closing tag for a leaf": (_file(_tree("A", "<AlwaysSuccess></AlwaysSuccess>")), []),
    "blanks in a closing tag": (_file(_tree("A", '<Sleep msec = "1" />')), []),
    # Without model
    "undeclared nodes in a sequence": (
        _file(_tree("A", '<Sequence><Drive to="{p}"/><Drive to="{q}"/><Dock/></Sequence>')),
        ["undeclared-tree-node"] * 2,
    ),
    "an undeclared condition with an explicit tag": (_file(_tree("A", '<Condition ID="IsOpen" door="1"/>')), []),
    "an undeclared action with an explicit tag": (_file(_tree("A", '<Action ID="Drive" to="{p}"/>')), []),
    "a node of another library": (
        _file(_tree("A", '<ForEachPoint points="{all}" point="{p}"><Drive to="{p}"/></ForEachPoint>')),
        ["undeclared-tree-node"] * 2,
    ),
    # Version 3
    "version 3 with remapped ports": (
        _file(_tree("A", '<SubTree ID="Other" target="goal"/>'), _OTHER, _WITH_ACT, attributes=_OLD),
        ["tree-format"],
    ),
    "version 3 with memory in a fallback": (
        _file(_tree("A", f"<Fallback><SequenceStar>{_DONE}</SequenceStar></Fallback>"), attributes=_OLD),
        ["tree-format"],
    ),
    "version 3 with an automatic subtree": (
        _file(_tree("A", '<SubTreePlus ID="Other" __autoremap="true"/>'), _OTHER, _WITH_ACT, attributes=_OLD),
        ["tree-format"],
    ),
    "unmarked version 3 with the name of a tree as a tag": (
        _file(_tree("A", '<Other target="goal"/>'), _OTHER, _WITH_ACT, attributes=""),
        ["tree-format"],
    ),
    "unmarked version 3": (
        _file(_tree("A", f'<RetryUntilSuccesful num_attempts="2">{_DONE}</RetryUntilSuccesful>'), attributes=""),
        ["tree-format"],
    ),
    "unmarked with a main tree": (
        _file(_tree("A", _DONE), attributes=' main_tree_to_execute="A"'),
        ["tree-format"],
    ),
    "unmarked without ID": (
        _file(f"<BehaviorTree>{_DONE}</BehaviorTree>", attributes=""),
        ["tree-format", "tree-without-id"],
    ),
    # Values that are not escaped
    "an unescaped script": (_file(_tree("A", '<ScriptCondition code="a < 1 && b"/>')), ["xml-not-escaped"]),
    "an unescaped condition in a switch": (
        _file(_tree("A", f'<Sequence _while="a <= 2">{_DONE}{_DONE}</Sequence>')),
        ["xml-not-escaped"],
    ),
}

REFUSED: dict[str, tuple[str, str, str]] = {
    "an unknown tree": (_file(_tree("A", '<SubTree ID="B"/>')), "unknown-subtree", "'B'"),
    "a package of ROS": (
        _file('<include ros_pkg="p" path="b.xml"/>', _tree("A", _DONE)),
        "tree-include",
        "packages of ROS",
    ),
    "a misspelt node": (_file(_tree("A", f"<Sequnce>{_DONE}</Sequnce>")), "unknown-tree-node", "'Sequnce'"),
    "a misspelt port": (_file(_tree("A", '<Sleep msek="1"/>')), "unknown-port", "'msek'"),
    "a missing port": (_file(_tree("A", "<Sleep/>")), "missing-port", "'msec'"),
    "a wrong number": (_file(_tree("A", f'<Repeat num_cycles="twice">{_DONE}</Repeat>')), "port-value", "'twice'"),
    "a decorator with two children": (
        _file(_tree("A", f"<Inverter>{_DONE}{_DONE}</Inverter>")),
        "wrong-children",
        "'Inverter'",
    ),
    "a control node without children": (_file(_tree("A", "<Sequence/>")), "wrong-children", "'Sequence'"),
    "a leaf with a child": (
        _file(_tree("A", f"<AlwaysSuccess>{_DONE}</AlwaysSuccess>")),
        "wrong-children",
        "'AlwaysSuccess'",
    ),
    "two roots of a tree": (_file(_tree("A", _DONE + _DONE)), "wrong-children", "one root"),
    "a node for terminals": (
        _file(_tree("A", f"<ManualSelector>{_DONE}</ManualSelector>")),
        "unsupported-tree-node",
        "'ManualSelector'",
    ),
    "a check of version 3": (
        _file(_tree("A", f'<BlackboardCheckInt value_A="1" value_B="2">{_DONE}</BlackboardCheckInt>'), attributes=_OLD),
        "unsupported-tree-node",
        "'BlackboardCheckInt'",
    ),
    "a queue as a node": (_file(_tree("A", '<QueueSize queue="{q}"/>')), "unsupported-tree-node", "'QueueSize'"),
    "bits in a script": (_file(_tree("A", '<Script code="a := b | 1"/>')), "script-unsupported", "|"),
    "joined texts in a script": (_file(_tree("A", "<Script code=\"a := 'x' .. b\"/>")), "script-unsupported", ".."),
    "a script without end": (_file(_tree("A", '<Script code="a := (1"/>')), "script-syntax", "code"),
    "a blank in an entry": (_file(_tree("A", '<Act x="{my goal}"/>'), _WITH_ACT), "port-value", "{my goal}"),
    "a format of the future": (_file(_tree("A", _DONE), attributes=' BTCPP_format="5"'), "no-tree-file", "'5'"),
    "another kind of file": ("<launch><node/></launch>", "no-tree-file", "<launch>"),
    "an unknown main tree": (
        _file(_tree("A", _DONE), attributes=' BTCPP_format="4" main_tree_to_execute="B"'),
        "unknown-subtree",
        "'B'",
    ),
    "a tree in itself": (_file(_tree("A", '<SubTree ID="A"/>')), "subtree-recursion", "A -> A"),
    "two trees of one ID": (_file(_tree("A", _DONE), _tree("A", _DONE)), "duplicate-tree", "'A'"),
    "an element that is out of place": (_file(_tree("A", _DONE), "<Trees/>"), "misplaced-element", "<Trees>"),
    "a node without ID": (_file(_tree("A", "<Action/>")), "missing-attribute", "'ID'"),
    "a document type": ("<!DOCTYPE root>" + _file(_tree("A", _DONE)), "xml-doctype", "document types"),
}
