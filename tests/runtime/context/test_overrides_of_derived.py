"""Overrides and derived variables: an override of an input, and of the derived variable itself."""

from __future__ import annotations

from pathlib import Path

from codra_dsl.logic import value
from codra_dsl.runtime import ContextManager, Journal, SimClock
from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.values.conditions import first_known, known
from codra_dsl.runtime.values.conditions_held import has_held
from codra_dsl.runtime.values.declarations import DERIVED
from tests.runtime.forests import forest, given, variable
from tests.runtime.journal.journals import read

READY = forest(
    [
        given("closed", valid_for_s=20.0),
        given("charged", valid_for_s=60.0),
        variable("ready", derived=value("closed") & value("charged"), sources=(DERIVED,)),
    ]
)


def started(path: Path | None = None) -> ContextManager[str, str]:
    record = None if path is None else Journal(path)
    return ContextManager[str, str](READY, clock=SimClock(), resources={}, record=record)


def value_of_ready(codra: ContextManager[str, str]) -> bool | None:
    content = codra.get("ready").content
    assert content is None or isinstance(content, bool)
    return content


def test_a_derived_variable_follows_the_override_of_an_input_and_its_end() -> None:
    with started() as codra:
        codra.set("closed", True)
        codra.set("charged", True)
        codra.override("closed", False, for_s=5.0, reason="bolt bent")
        assert value_of_ready(codra) is False
        codra.clock.sleep(5.0)
        assert value_of_ready(codra) is True
        codra.override("closed", None, for_s=5.0, reason="bolt bent")
        assert codra.get("ready").detail == "closed is unknown (overridden)"
        codra.clear_override("closed")
        assert value_of_ready(codra) is True


def test_a_derived_variable_goes_on_beneath_its_own_override() -> None:
    with started() as codra:
        codra.set("closed", True)
        codra.set("charged", True)
        codra.override("ready", False, for_s=30.0, reason="service")
        codra.clock.sleep(10.0)
        assert (value_of_ready(codra), codra.get("ready").source) == (False, "operator")
        codra.set("charged", False)
        codra.set("charged", True)
        codra.clock.sleep(15.0)  # `closed` has expired beneath the override
        assert value_of_ready(codra) is False
        codra.clear_override("ready")
        assert codra.get("ready").detail == "closed is unknown (stale)"


def test_what_follows_from_an_override_is_no_evidence_either() -> None:
    terms = {"safe": first_known(value("closed"), False), "blind": ~known("closed")}
    derived = [variable(name, derived=term, sources=(DERIVED,)) for name, term in terms.items()]
    with ContextManager[str, str](
        forest([given("closed", valid_for_s=20.0), *derived]), clock=SimClock(), resources={}
    ) as codra:
        codra.set("closed", True)
        codra.clock.sleep(2.0)
        codra.override("closed", None, for_s=5.0, reason="bolt bent")
        assert (codra.get("safe").value, codra.get("blind").value) == (False, True)
        for name in terms:
            assert codra.decide(name, lambda: None, since_s=1.0) is None


def test_why_explains_a_derived_variable_beneath_its_override() -> None:
    with started() as codra:
        codra.set("charged", True)
        codra.override("ready", True, for_s=30.0, reason="service")
        beneath = codra.why("ready").beneath
        assert beneath is not None
        assert beneath.derivation is not None
        assert [why.variable for why in beneath.derivation.inputs] == ["closed"]
        assert [str(change) for change in beneath.missing] == ["only main_execution may write closed"]


def test_whether_a_condition_on_a_derived_variable_has_held_respects_past_overrides() -> None:
    with started() as codra:
        codra.set("closed", True)
        codra.set("charged", True)
        codra.clock.sleep(2.0)
        codra.override("ready", False, for_s=3.0, reason="service")
        codra.clock.sleep(8.0)
        cells = codra._store.cells
        held = [
            has_held(value("ready"), cells, start_s, end_s) for start_s, end_s in ((0, 1.9), (0, 2), (4, 6), (5, 9))
        ]
        assert held == [True, False, False, True]


def test_overrides_of_derived_variables_and_inputs_are_replayed_and_explained(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with started(path) as codra:
        codra.set("closed", True)
        codra.set("charged", True)
        codra.override("closed", False, for_s=2.0, reason="bolt bent")
        codra.clock.sleep(1.0)
        assert "closed" in str(codra.why("ready"))
        assert "bolt bent" in str(codra.why("ready"))
        codra.override("ready", True, for_s=3.0, reason="seen by hand")
        codra.clock.sleep(1.5)
        assert "seen by hand" in str(codra.why("ready"))
        codra.clock.sleep(30.0)

    header, events = read(path)
    result = replay(header, events, READY, ContextManager[str, str], None)
    assert result.difference is None
    assert [event.what for event in events if event.kind is Kind.OVERRIDE] == ["begun", "begun", "expired", "expired"]
