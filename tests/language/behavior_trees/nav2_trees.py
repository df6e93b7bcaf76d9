"""Bodies of trees with the shapes of the trees that Nav2 has; written for these tests from Nav2's list of nodes."""

from __future__ import annotations

_PLAN = '<ComputePathToPose goal="{goal}" path="{path}" planner_id="{planner}" error_code_id="{plan_error}"/>'
_PLAN_MANY = '<ComputePathThroughPoses goals="{goals}" path="{path}" planner_id="{planner}"/>'
_FOLLOW = '<FollowPath path="{path}" controller_id="{controller}" error_code_id="{follow_error}"/>'
_CLEAR_ALL = (
    '<Sequence><ClearEntireCostmap name="local-map" service_name="local_costmap/clear"/>'
    '<ClearEntireCostmap name="global-map" service_name="global_costmap/clear"/></Sequence>'
)
_SELECT = (
    '<ControllerSelector selected_controller="{controller}" default_controller="A" topic_name="c"/>'
    '<PlannerSelector selected_planner="{planner}" default_planner="B" topic_name="p"/>'
)
_TURN = '<Spin spin_dist="1.57" error_code_id="{spin_error}"/>'
_BACK = '<Wait wait_duration="5.0"/><BackUp backup_dist="0.3" backup_speed="0.1"/>'


def _recovering(body: str, recovery: str = "", retries: int = 1) -> str:
    return f'<RecoveryNode number_of_retries="{retries}">{body}{recovery or _CLEAR_ALL}</RecoveryNode>'


def _navigate(steps: str, actions: str = _TURN + _BACK) -> str:
    recovery = f"<ReactiveFallback><GoalUpdated/><RoundRobin>{_CLEAR_ALL}{actions}</RoundRobin></ReactiveFallback>"
    return _recovering(f"<PipelineSequence>{_SELECT}{steps}</PipelineSequence>", recovery, 6)


def _helped(condition: str, error: str) -> str:
    return f'<Sequence><{condition} error_code="{{{error}}}"/>{_CLEAR_ALL}</Sequence>'


def _unless_valid(action: str, *conditions: str) -> str:
    inverted = "".join(f"<Inverter>{condition}</Inverter>" for condition in conditions)
    return f'<Fallback><ReactiveSequence>{inverted}<IsPathValid path="{{path}}"/></ReactiveSequence>{action}</Fallback>'


_ROUTE = '<ComputeRoute goal="{goal}" path="{route_path}" route="{route}" use_poses="true" error_code_id="{r}"/>'
_FOLLOWED = _recovering(_FOLLOW, _helped("WouldAControllerRecoveryHelp", "follow_error"))
_MILE = (
    '<ReactiveSequence><GetCurrentPose current_pose="{here}"/><GetPoseFromPath path="{route_path}" index="{i}" '
    'pose="{end}"/><Inverter><ArePosesNear ref_pose="{here}" target_pose="{end}" tolerance="0.3"/></Inverter>'
    '<ComputePathToPose goal="{end}" path="{mile}"/><ConcatenatePaths input_path1="{mile}" input_path2="{route_path}" '
    'output_path="{route_path}"/></ReactiveSequence>'
)
_STEP = '<DriveOnHeading dist_to_travel="0.2" speed="0.02" time_allowance="100"/><Spin spin_dist="1.57"/>'

NAV2_TREES: dict[str, str] = {
    "plan and follow": f"<Sequence>{_PLAN}{_FOLLOW}</Sequence>",
    "replan at a rate and recover": _navigate(
        f'<RateController hz="1.0">{_recovering(_PLAN)}</RateController>{_FOLLOWED}'
    ),
    "replan by distance": f'<PipelineSequence><DistanceController distance="1.0">{_PLAN}</DistanceController>{_FOLLOW}'
    "</PipelineSequence>",
    "replan by speed": f'<PipelineSequence><SpeedController min_rate="0.1" max_rate="1.0" min_speed="0.0" '
    f'max_speed="0.26">{_PLAN}</SpeedController>{_FOLLOW}</PipelineSequence>',
    "replan by time": f'<PipelineSequence><RateController hz="0.5">{_PLAN}</RateController>{_FOLLOW}'
    "</PipelineSequence>",
    "replan for a new goal": f"<PipelineSequence><GoalUpdatedController>{_PLAN}</GoalUpdatedController>{_FOLLOW}"
    "</PipelineSequence>",
    "replan if the path is invalid": _navigate(
        '<RateController hz="2.0">'
        + _recovering(_unless_valid(_PLAN, "<GlobalUpdatedGoal/>"))
        + f"</RateController>{_FOLLOWED}"
    ),
    "replan if the path is invalid or old": _navigate(
        '<RateController hz="2.0">'
        + _recovering(_unless_valid(_PLAN, '<PathExpiringTimer seconds="10" path="{path}"/>', "<GlobalUpdatedGoal/>"))
        + f"</RateController>{_FOLLOWED}"
    ),
    "through poses": _navigate(
        '<RateController hz="0.333">'
        + _recovering(
            '<ReactiveSequence><RemovePassedGoals input_goals="{goals}" output_goals="{goals}" radius="0.7"/>'
            f"{_PLAN_MANY}</ReactiveSequence>"
        )
        + f"</RateController>{_FOLLOWED}"
    ),
    "patience at the goal": _navigate(
        f'<RateController hz="1.0">{_recovering(_PLAN)}</RateController><ReactiveSequence>'
        '<PathLongerOnApproach path="{path}" prox_len="3.0" length_factor="2.0"><RetryUntilSuccessful num_attempts="1">'
        '<SequenceWithMemory><CancelControl/><Wait wait_duration="5.0"/></SequenceWithMemory></RetryUntilSuccessful>'
        f"</PathLongerOnApproach>{_FOLLOWED}</ReactiveSequence>"
    ),
    "follow a point": '<PipelineSequence><RateController hz="1.0"><Sequence><GoalUpdater input_goal="{goal}" '
    'output_goal="{updated}"><ComputePathToPose goal="{updated}" path="{path}"/></GoalUpdater>'
    '<TruncatePath distance="1.0" input_path="{path}" output_path="{short}"/></Sequence></RateController>'
    '<KeepRunningUntilFailure><FollowPath path="{short}" controller_id="A"/></KeepRunningUntilFailure>'
    "</PipelineSequence>",
    "calibrate the odometry": f'<Sequence name="Drive in a square">{_STEP * 4}</Sequence>',
    "follow a route": _navigate(
        '<RateController hz="0.5">'
        + _unless_valid(
            f'<Sequence>{_ROUTE}{_MILE}{_MILE}<SmoothPath unsmoothed_path="{{route_path}}" smoothed_path="{{path}}" '
            'smoother_id="route_smoother"/></Sequence>',
            "<GlobalUpdatedGoal/>",
        )
        + f"</RateController>{_FOLLOWED}",
        _BACK,
    ),
    "plan along a route": _navigate(
        f'<RateController hz="0.5">{_unless_valid(_ROUTE, "<GlobalUpdatedGoal/>")}</RateController>'
        f'<RateController hz="1.0">{_recovering(_PLAN_MANY)}</RateController>{_FOLLOWED}'
    ),
    "stay within bounds": f"<Sequence>{_PLAN}<ReactiveSequence>"
    f'<IsWithinPathTrackingBounds max_position_error_left="0.2" tracking_feedback="{{feedback}}"/>{_FOLLOW}'
    "</ReactiveSequence></Sequence>",
    "recover by error codes": _recovering(
        f"<PipelineSequence>{_recovering(_PLAN, _helped('WouldAPlannerRecoveryHelp', 'plan_error'))}{_FOLLOWED}"
        "</PipelineSequence>",
        '<Sequence><Fallback><WouldAControllerRecoveryHelp error_code="{follow_error}"/><AreErrorCodesPresent '
        f'error_code="{{plan_error}}" error_codes_to_check="201,202"/></Fallback><RoundRobin>{_BACK}</RoundRobin>'
        "</Sequence>",
        6,
    ),
    "dock": '<Sequence><DockRobot dock_id="{dock}" use_dock_id="true" success="{docked}"/><IsBatteryCharging '
    'battery_topic="/battery"/><UndockRobot dock_type="a"/></Sequence>',
}
