"""Previews in stories: the steps that ask for them, and the checks of their answers."""

from __future__ import annotations

import pytest

from codra_dsl.integrations.testing.run import StoryFailed
from codra_dsl.runtime import Kind
from tests.integrations.testing.timelines import HEAD, findings, kitchen_run

STORY = """\
start:
  perception:
    find_kettle: {{returns: {{bearing: 0 deg}}}}
    ask_dock: {{returns: {{contact: true}}, takes: 1 s}}
    look_at_kettle: {{returns: {{water: 500 g, steam: 0 percent, warmth: 20, sharpness: 1}}}}
    weigh_kettle: {{returns: {{weight: 12 N}}}}
  main_execution: {{set: {{robot_is_localized: true, robot_place: counter, light_is_on: true}}}}
stories:
  case:
    0 s: {{previews: {{boil_water: unknown}}, main_execution: {{expect: [boil_water], preview: [boil_water]}}}}
    10 s: {{previews: {{boil_water: holds}}, main_execution: {{preview: [boil_water]}}}}
    11 s: {{perception: {{ask_dock: {{returns: {{contact: false}}}}}}}}
    20 s: {{previews: {{boil_water: {check}}}}}
"""


def test_a_story_asks_for_previews_and_checks_their_answers_with_the_reason() -> None:
    run = kitchen_run(STORY.format(check="{is: violated, because: kettle_docked == true}"))
    run.play()
    previews = run.codra.record.of(Kind.PREVIEW)
    assert [(event.instant_s, event.details["outcome"]) for event in previews] == [(0.0, "unknown"), (10.0, "holds")]


@pytest.mark.parametrize(
    ("check", "message"),
    [
        ("holds", "at 20 s the preview of boil_water should be 'holds', but it is 'violated'"),
        (
            "{is: violated, because: kettle_water}",
            "at 20 s the preview of boil_water should be 'violated' because of 'kettle_water', but it is 'violated'",
        ),
    ],
)
def test_a_wrong_answer_is_a_failure_with_the_explanation(check: str, message: str) -> None:
    with pytest.raises(StoryFailed) as raised:
        kitchen_run(STORY.format(check=check)).play()
    assert f"tests/case.timeline.yaml:15:35: {message}" in str(raised.value)
    assert "the preview is violated: kettle_docked == true" in str(raised.value)


def test_mistakes_in_checks_of_previews_are_findings() -> None:
    text = HEAD + "stories: {case: {0 s: {previews: {boil_watre: holds, cook: hold, pour_water: {because: x}}}}}\n"
    messages = [f"{finding.message}; {finding.help}" for finding in findings(text)]
    assert "spec 'kitchen' has no skill 'boil_watre'; did you mean 'boil_water'?" in messages
    assert len(messages) == 3
