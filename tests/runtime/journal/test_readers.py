"""Journals in other programs: independent readers of MCAP, and the schemas of all messages."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import small_mcap
from mcap.reader import make_reader

from codra_dsl.runtime import WallClock
from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.journal.schemas import TOPICS, kind_of
from generated import kitchen, lab
from tests.campaigns.whys.arena import package, run_until
from tests.runtime.forests import World
from tests.runtime.journal.journals import run_door
from tests.runtime.replay.test_replay import hammer, journalled, unruly, unruly_forest


@pytest.fixture(scope="module")
def journals(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Long runs of the laboratory's spec, the kitchen's spec, random specs, a door, and a run in real time."""
    folder = tmp_path_factory.mktemp("journals")
    for number, module in enumerate((lab, kitchen, *(package(seed, folder / "specs") for seed in (5, 6, 7)))):
        run_until(module, number, 60.0, folder / f"{number}.mcap").manager.close()
    run_door(folder / "door.mcap", loops=30)
    model = unruly_forest(1)
    names = [name for observer in model.observers for name in observer.identifies]
    world = World({f"look_{name}_{rank}": unruly for name in names for rank in range(2)})
    with WallClock() as clock, journalled(model, world, folder / "real.mcap", clock, 1) as manager:
        hammer(manager, clock, 1, clock.now_s() + 1.0)
    return sorted(folder.glob("*.mcap"))


def test_another_reader_of_mcap_finds_the_same_messages(journals: list[Path]) -> None:
    """`small_mcap` shares no code with the library that writes journals."""
    for path in journals:
        with path.open("rb") as stream:
            mcap_messages = make_reader(stream).iter_messages(log_time_order=False)
            mcap_contents = sorted(
                (channel.topic, message.log_time, message.sequence, message.data)
                for _, channel, message in mcap_messages
            )
        with path.open("rb") as stream:
            small_mcap_contents = [
                (channel.topic, message.log_time, message.sequence, bytes(message.data))
                for _, channel, message in small_mcap.read_message(stream)
            ]
        assert sorted(small_mcap_contents) == mcap_contents
        assert len(mcap_contents) > 300


def test_every_message_matches_its_schema_which_knows_all_its_fields(journals: list[Path]) -> None:
    event_counts: Counter[tuple[Kind, str]] = Counter()
    for path in journals:
        validators: dict[int, Any] = {}
        with path.open("rb") as stream:
            for schema, channel, message in make_reader(stream).iter_messages():
                assert schema is not None
                if schema.id not in validators:
                    validators[schema.id] = jsonschema.Draft202012Validator(json.loads(schema.data))
                content, kind = json.loads(message.data), kind_of(channel.topic)
                validators[schema.id].validate(content)
                assert set(content) <= set(validators[schema.id].schema["properties"])
                if kind is not None:
                    event_counts[kind, content["what"]] += 1
    unused_kinds = {Kind.HOST, Kind.PREVIEW, Kind.OVERRIDE, Kind.KNOWLEDGE, Kind.ADAPTATION}
    assert {kind for kind, _ in event_counts} == set(Kind) - unused_kinds
    assert len(event_counts) >= 30, "the runs must contain most kinds of events"


def test_every_kind_of_event_has_its_topic_and_no_two_share_one() -> None:
    assert set(TOPICS) == set(Kind)
    assert len({topic.folder for topic in TOPICS.values()}) == len(TOPICS)
    for kind, topic in TOPICS.items():
        assert kind_of(topic.folder) is kind
        assert kind_of(f"{topic.folder}/name") is kind
        assert kind_of(f"{topic.folder}s") is None


def test_a_message_with_a_surplus_field_does_not_match_its_schema(tmp_path: Path) -> None:
    """The schemas allow no further fields, so the check in the test above can fail."""
    run_door(tmp_path / "run.mcap", loops=1)
    with (tmp_path / "run.mcap").open("rb") as stream:
        for schema, _, message in make_reader(stream).iter_messages():
            assert schema is not None
            content = {**json.loads(message.data), "surplus": 1}
            with pytest.raises(jsonschema.ValidationError, match="surplus"):
                jsonschema.Draft202012Validator(json.loads(schema.data)).validate(content)
