"""Texts of the kinds that robots in the field have; written for these tests from the node lists of the documentation.

Each text of `TEXTS` has the rules of its findings, all of which are warnings.
"""

from __future__ import annotations

NAV2_MODELS = """
<Action ID="ComputePathToPose"><input_port name="goal"/><input_port name="start"/><input_port name="planner_id"/>
  <input_port name="server_timeout"/><output_port name="path"/><output_port name="error_code_id"/></Action>
<Action ID="ComputePathThroughPoses"><input_port name="goals"/><input_port name="planner_id"/>
  <output_port name="path"/><output_port name="error_code_id"/></Action>
<Action ID="FollowPath"><input_port name="path"/><input_port name="controller_id" default="FollowPath"/>
  <output_port name="error_code_id"/></Action>
<Action ID="SmoothPath"><input_port name="unsmoothed_path"/><input_port name="smoother_id" default="S"/>
  <output_port name="smoothed_path"/></Action>
<Action ID="TruncatePath"><input_port name="distance"/><input_port name="input_path"/>
  <output_port name="output_path"/></Action>
<Action ID="RemovePassedGoals"><input_port name="input_goals"/><output_port name="output_goals"/>
  <input_port name="radius"/></Action>
<Action ID="PlannerSelector"><input_port name="topic_name"/><input_port name="default_planner"/>
  <output_port name="selected_planner"/></Action>
<Action ID="ControllerSelector"><input_port name="topic_name"/><input_port name="default_controller"/>
  <output_port name="selected_controller"/></Action>
<Action ID="ClearEntireCostmap"><input_port name="service_name"/><input_port name="server_timeout"/></Action>
<Action ID="Spin"><input_port name="spin_dist"/><output_port name="error_code_id"/></Action>
<Action ID="Wait"><input_port name="wait_duration"/></Action>
<Action ID="BackUp"><input_port name="backup_dist"/><input_port name="backup_speed"/></Action>
<Action ID="DriveOnHeading"><input_port name="dist_to_travel"/><input_port name="speed"/>
  <input_port name="time_allowance"/></Action>
<Action ID="CancelControl"><input_port name="server_name"/></Action>
<Action ID="ComputeRoute"><input_port name="goal"/><input_port name="use_poses"/><output_port name="path"/>
  <output_port name="route"/><output_port name="error_code_id"/></Action>
<Action ID="GetCurrentPose"><output_port name="current_pose"/></Action>
<Action ID="GetPoseFromPath"><input_port name="path"/><input_port name="index"/><output_port name="pose"/></Action>
<Action ID="ConcatenatePaths"><input_port name="input_path1"/><input_port name="input_path2"/>
  <output_port name="output_path"/></Action>
<Action ID="DockRobot"><input_port name="dock_id"/><input_port name="use_dock_id"/>
  <output_port name="success"/></Action>
<Action ID="UndockRobot"><input_port name="dock_type"/></Action>
<Condition ID="GlobalUpdatedGoal"/>
<Condition ID="PathExpiringTimer"><input_port name="seconds"/><input_port name="path"/></Condition>
<Condition ID="ArePosesNear"><input_port name="ref_pose"/><input_port name="target_pose"/>
  <input_port name="tolerance"/></Condition>
<Condition ID="IsBatteryCharging"><input_port name="battery_topic"/></Condition>
<Condition ID="IsWithinPathTrackingBounds"><input_port name="max_position_error_left"/>
  <input_port name="tracking_feedback"/></Condition>
<Condition ID="WouldAControllerRecoveryHelp"><input_port name="error_code"/></Condition>
<Condition ID="AreErrorCodesPresent"><input_port name="error_code"/>
  <input_port name="error_codes_to_check"/></Condition>
<Condition ID="GoalUpdated"/>
<Condition ID="GoalReached"><input_port name="goal"/></Condition>
<Condition ID="IsBatteryLow"><input_port name="min_battery"/><input_port name="battery_topic"/></Condition>
<Condition ID="IsPathValid"><input_port name="path"/></Condition>
<Condition ID="IsStuck"/>
<Condition ID="TimeExpired"><input_port name="seconds"/></Condition>
<Condition ID="WouldAPlannerRecoveryHelp"><input_port name="error_code"/></Condition>
<Control ID="PipelineSequence"/>
<Control ID="RecoveryNode"><input_port name="number_of_retries"/></Control>
<Control ID="RoundRobin"/>
<Control ID="NonblockingSequence"/>
<Control ID="PersistentSequence"><bidirectional_port name="current_child_idx"/></Control>
<Decorator ID="RateController"><input_port name="hz"/></Decorator>
<Decorator ID="DistanceController"><input_port name="distance"/></Decorator>
<Decorator ID="SpeedController"><input_port name="min_rate"/><input_port name="max_rate"/>
  <input_port name="min_speed"/><input_port name="max_speed"/></Decorator>
<Decorator ID="SingleTrigger"/>
<Decorator ID="GoalUpdater"><input_port name="input_goal"/><output_port name="output_goal"/></Decorator>
<Decorator ID="PathLongerOnApproach"><input_port name="path"/><input_port name="prox_len"/>
  <input_port name="length_factor"/></Decorator>
<Decorator ID="GoalUpdatedController"/>
"""
"""Declarations of nodes of Nav2: names, kinds and ports, as its list of nodes has them."""

PLAN = '<ComputePathToPose goal="{goal}" path="{path}" planner_id="GridBased"/>'
FOLLOW = '<FollowPath path="{path}" controller_id="FollowPath"/>'
CLEAR = '<ClearEntireCostmap name="clear" service_name="local_costmap/clear"/>'
RECOVER = f"""<ReactiveFallback name="recover"><GoalUpdated/>
  <RoundRobin name="actions">{CLEAR}<Spin spin_dist="1.57"/><Wait wait_duration="5.0"/>
    <BackUp backup_dist="0.3" backup_speed="0.05"/></RoundRobin></ReactiveFallback>"""

NAV2_BODIES = {
    "replan at a rate": f'<PipelineSequence><RateController hz="1.0">{PLAN}</RateController>{FOLLOW}'
    "</PipelineSequence>",
    "replan by distance": f'<PipelineSequence><DistanceController distance="1.0">{PLAN}</DistanceController>{FOLLOW}'
    "</PipelineSequence>",
    "replan by speed": f'<PipelineSequence><SpeedController min_rate="0.1" max_rate="1.0">{PLAN}</SpeedController>'
    f"{FOLLOW}</PipelineSequence>",
    "replan for a new goal": f"<PipelineSequence><GoalUpdatedController>{PLAN}</GoalUpdatedController>{FOLLOW}"
    "</PipelineSequence>",
    "recovery": f'<RecoveryNode number_of_retries="6" name="navigate"><PipelineSequence name="replan">'
    f'<RateController hz="1.0"><RecoveryNode number_of_retries="1" name="plan">{PLAN}{CLEAR}</RecoveryNode>'
    f'</RateController><RecoveryNode number_of_retries="1" name="follow">{FOLLOW}{CLEAR}</RecoveryNode>'
    f"</PipelineSequence>{RECOVER}</RecoveryNode>",
    "plan once": f"<Sequence><SingleTrigger>{PLAN}</SingleTrigger>{FOLLOW}</Sequence>",
    "follow a moving goal": '<PipelineSequence><GoalUpdater input_goal="{goal}" output_goal="{updated_goal}">'
    '<ComputePathToPose goal="{updated_goal}" path="{path}"/></GoalUpdater>'
    f"<KeepRunningUntilFailure>{FOLLOW}</KeepRunningUntilFailure></PipelineSequence>",
    "path grows": f'<PathLongerOnApproach path="{{path}}" prox_len="3.0">{CLEAR}</PathLongerOnApproach>',
    "select plugins": '<Sequence><PlannerSelector selected_planner="{planner}" default_planner="A" topic_name="p"/>'
    '<ControllerSelector selected_controller="{controller}" default_controller="B" topic_name="c"/></Sequence>',
    "many goals": '<Sequence><RemovePassedGoals input_goals="{goals}" output_goals="{goals}" radius="0.7"/>'
    '<ComputePathThroughPoses goals="{goals}" path="{path}" planner_id="GridBased"/></Sequence>',
    "smooth": '<SmoothPath unsmoothed_path="{path}" smoothed_path="{path}"/>',
    "persistent": '<PersistentSequence current_child_idx="{index}"><Wait wait_duration="1"/></PersistentSequence>',
    "nonblocking": f"<NonblockingSequence>{FOLLOW}<IsStuck/></NonblockingSequence>",
    "help": '<Fallback><WouldAPlannerRecoveryHelp error_code="{code}"/><IsBatteryLow min_battery="0.2" '
    'battery_topic="/battery"/></Fallback>',
    "valid path": f'<ReactiveSequence><IsPathValid path="{{path}}"/><Inverter><TimeExpired seconds="10"/></Inverter>'
    f"{FOLLOW}</ReactiveSequence>",
}


def nav2_file(body: str) -> str:
    """Return a file of Nav2: it declares no node."""
    tree = f'<BehaviorTree ID="MainTree">{body}</BehaviorTree>'
    return f'<root BTCPP_format="4" main_tree_to_execute="MainTree">{tree}</root>'


def _file(body: str, *, models: str = "", attributes: str = 'BTCPP_format="4"', others: str = "") -> str:
    declarations = f"<TreeNodesModel>{models}</TreeNodesModel>" if models else ""
    return f'<root {attributes}><BehaviorTree ID="Main">{body}</BehaviorTree>{others}{declarations}</root>'


def _own(kind: str, id_: str, *ports: str) -> str:
    return f'<{kind} ID="{id_}">{"".join(ports)}</{kind}>'


_SUB = '<BehaviorTree ID="Sub"><Act x="{q}"/></BehaviorTree>'
_ACT = _own("Action", "Act", '<input_port name="x"/>')
_OLD = 'BTCPP_format="3"'
_UNDECLARED = "undeclared-tree-node"

TEXTS: dict[str, tuple[str, list[str]]] = {
    # Nodes that only the robot's program declares
    "an undeclared leaf": (_file('<GoTo pose="{p}"/>'), [_UNDECLARED]),
    "an undeclared leaf twice": (_file("<Sequence><GoTo/><GoTo/></Sequence>"), [_UNDECLARED]),
    "an undeclared control node": (_file("<Race><GoTo/><Sing/></Race>"), [_UNDECLARED] * 3),
    "an undeclared decorator": (_file('<Every s="5"><GoTo/></Every>'), [_UNDECLARED] * 2),
    "an explicit control node": (_file('<Control ID="Race"><AlwaysSuccess/><AlwaysFailure/></Control>'), []),
    "an explicit decorator": (_file('<Decorator ID="Every" s="5"><AlwaysSuccess/></Decorator>'), []),
    "a declared control node": (
        _file(
            "<Race n='2'><AlwaysSuccess/><AlwaysFailure/></Race>",
            models=_own("Control", "Race", '<input_port name="n"/>'),
        ),
        [],
    ),
    "a declared decorator": (_file("<Every><AlwaysSuccess/></Every>", models=_own("Decorator", "Every")), []),
    "a loop of the robot": (
        _file(
            '<ForEachPose vector_in="{poses}" out="{pose}"><Act x="{pose}"/></ForEachPose>',
            models=_ACT
            + _own("Decorator", "ForEachPose", '<input_port name="vector_in"/>', '<output_port name="out"/>'),
        ),
        [],
    ),
    "a nested decorator": (
        _file("<Every><Every><AlwaysSuccess/></Every></Every>", models=_own("Decorator", "Every")),
        [],
    ),
    "conditions of a control node": (
        _file('<Race _skipIf="done" _onSuccess="done := true"><AlwaysSuccess/></Race>', models=_own("Control", "Race")),
        [],
    ),
    # Ports
    "no value for an input": (_file("<Act/>", models=_ACT), ["port-without-value"]),
    "no value for two inputs": (
        _file("<Act/>", models=_own("Action", "Act", '<input_port name="x"/><input_port name="y"/>')),
        ["port-without-value"],
    ),
    "a port that is not declared": (_file('<Act x="1" quality="2"/>', models=_ACT), ["undeclared-port"]),
    "JSON in a port": (_file("""<Act x='json:{"a":1}'/>""", models=_ACT), []),
    "a shell variable": (_file('<Act x="${HOME}"/>', models=_ACT), []),
    "one brace": (_file('<Act x="a}"/>', models=_ACT), []),
    "an opening brace": (_file('<Act x="{a"/>', models=_ACT), []),
    "a list of numbers": (_file('<Act x="1.0;2.0;3.0"/>', models=_ACT), []),
    "a global entry": (_file('<Act x="{@goal}"/>', models=_ACT), []),
    "an entry of the same name": (_file('<Act x="{=}"/>', models=_ACT), []),
    "a bidirectional port": (
        _file('<Act x="{a}"/>', models=_own("Action", "Act", '<bidirectional_port name="x"/>')),
        [],
    ),
    # Subtrees
    "a text for an inout port": (
        _file('<SubTree ID="Sub" q="5"/>', models=_ACT + _own("SubTree", "Sub", '<inout_port name="q"/>'), others=_SUB),
        [],
    ),
    "an extra remapping": (
        _file(
            '<SubTree ID="Sub" q="5" r="{s}"/>',
            models=_ACT + _own("SubTree", "Sub", '<inout_port name="q"/>'),
            others=_SUB,
        ),
        ["unused-remap"],
    ),
    "a queue for a loop in a subtree": (
        _file(
            '<SubTree ID="Loop" queue="1;2;3"/>',
            others='<BehaviorTree ID="Loop"><LoopDouble queue="{queue}" value="{v}"><AlwaysSuccess/></LoopDouble>'
            "</BehaviorTree>",
        ),
        [],
    ),
    "an automatic remapping": (_file('<SubTree ID="Sub" _autoremap="true"/>', models=_ACT, others=_SUB), []),
    # Data of editors
    "a collapsed subtree": (_file('<SubTree ID="Sub" q="1" _collapsed="true"/>', models=_ACT, others=_SUB), []),
    "a favorite": (
        '<root BTCPP_format="4"><BehaviorTree ID="M" _favorite="true" _description="d"><AlwaysSuccess/></BehaviorTree>'
        "</root>",
        [],
    ),
    "metadata of a node": (
        _file(
            '<Act x="1"/>',
            models=_own(
                "Action",
                "Act",
                '<MetadataFields><Metadata description="acts"/><Metadata runnable="true" group="a &amp; b"/>'
                '</MetadataFields><input_port name="x"/>',
            ),
        ),
        [],
    ),
    "metadata of a subtree": (
        _file(
            '<SubTree ID="Sub" q="1"/>',
            models=_ACT
            + _own(
                "SubTree", "Sub", '<MetadataFields><Metadata subcategory="arm"/></MetadataFields><input_port name="q"/>'
            ),
            others=_SUB,
        ),
        [],
    ),
    "a described node": (
        _file("<Act/>", models=_own("Action", "Act", "<description>acts &lt;fast&gt;</description>")),
        [],
    ),
    "a described port": (
        _file("<Act/>", models=_own("Action", "Act", '<output_port name="y" type="int">how many</output_port>')),
        [],
    ),
    # Files without ID or version
    "a tree without ID": (
        '<root BTCPP_format="4"><BehaviorTree><AlwaysSuccess/></BehaviorTree></root>',
        ["tree-without-id"],
    ),
    "a tree with an empty ID": (
        '<root BTCPP_format="4"><BehaviorTree ID=""><AlwaysSuccess/></BehaviorTree></root>',
        ["tree-without-id"],
    ),
    "no version": (_file("<AlwaysSuccess/>", attributes=""), ["tree-format"]),
    "neither version nor ID": (
        "<root><BehaviorTree><AlwaysSuccess/></BehaviorTree></root>",
        ["tree-format", "tree-without-id"],
    ),
    # Version 3
    "an empty file of version 3": (_file("<AlwaysSuccess/>", attributes=_OLD), ["tree-format"]),
    "a sequence with memory": (
        _file("<SequenceStar><AlwaysSuccess/></SequenceStar>", attributes=_OLD),
        ["tree-format"],
    ),
    "an explicit sequence with memory": (
        _file('<Control ID="SequenceStar"><AlwaysSuccess/></Control>', attributes=_OLD),
        ["tree-format"],
    ),
    "retries": (
        _file('<RetryUntilSuccesful num_attempts="3"><AlwaysSuccess/></RetryUntilSuccesful>', attributes=_OLD),
        ["tree-format"],
    ),
    "thresholds": (
        _file(
            '<Parallel success_threshold="1" failure_threshold="2"><AlwaysSuccess/><AlwaysFailure/></Parallel>',
            attributes=_OLD,
        ),
        ["tree-format"],
    ),
    "a single threshold": (
        _file('<Parallel threshold="1"><AlwaysSuccess/></Parallel>', attributes=""),
        ["tree-format"],
    ),
    "an entry without braces": (
        _file('<SubTree ID="Sub" q="goal"/>', attributes=_OLD, models=_ACT, others=_SUB),
        ["tree-format"],
    ),
    "shared entries": (
        _file('<SubTree ID="Sub" __shared_blackboard="true"/>', attributes="", models=_ACT, others=_SUB),
        ["tree-format"],
    ),
    "a subtree plus": (
        _file('<SubTreePlus ID="Sub" q="5" __autoremap="true"/>', attributes="", models=_ACT, others=_SUB),
        ["tree-format"],
    ),
    "a repetition": (
        _file('<Repeat num_cycles="2"><AlwaysSuccess/></Repeat>', attributes=f'{_OLD} main_tree_to_execute="Main"'),
        ["tree-format"],
    ),
    # Values that are not escaped
    "a raw and": (_file('<AlwaysSuccess _skipIf="a && b"/>'), ["xml-not-escaped"]),
    "a raw less": (_file('<AlwaysSuccess _while="a < 3"/>'), ["xml-not-escaped"]),
    "a raw script": (_file('<Script code="a := 1; b := a <= 2 && a >= 0"/>'), ["xml-not-escaped"]),
    "a raw precondition": (
        _file("<Precondition if=\"x < 2 && y == 'a'\" else='SKIPPED'><AlwaysSuccess/></Precondition>"),
        ["xml-not-escaped"],
    ),
    "half escaped": (_file('<AlwaysSuccess _skipIf="a &amp;& b" _while="c &lt; 1"/>'), ["xml-not-escaped"]),
    "a raw and in a text": (_file('<Act x="R&D"/>', models=_ACT), ["xml-not-escaped"]),
    "raw in single quotes": (_file("<AlwaysSuccess _skipIf='a && b'/><!-- a < b -->"), ["xml-not-escaped"]),
    # Layout
    "comments": (
        "<!-- a --><root BTCPP_format='4'><!-- b --><BehaviorTree ID='M'><!-- c --><AlwaysSuccess/></BehaviorTree>"
        "</root>",
        [],
    ),
    "a declaration": ('<?xml version="1.0" encoding="UTF-8"?>\n' + _file("<AlwaysSuccess/>"), []),
    "line breaks in a value": (_file('<Script code="a := 1;&#10;b := 2"/>'), []),
    "letters of many alphabets": (_file('<AlwaysSuccess name="Tür ☃ 機器人"/>'), []),
    "two trees": (_file("<AlwaysSuccess/>", others='<BehaviorTree ID="B"><AlwaysFailure/></BehaviorTree>'), []),
}
