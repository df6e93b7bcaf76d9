"""Run a state machine with RAFCON's engine, in real or in simulated time."""

from __future__ import annotations

import threading
import traceback
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rafcon.core.config import global_config
from rafcon.core.custom_exceptions import LibraryNotFoundException
from rafcon.core.singleton import (
    global_variable_manager,
    library_manager,
    state_machine_execution_engine,
    state_machine_manager,
)
from rafcon.core.start import setup_environment
from rafcon.core.state_machine import StateMachine
from rafcon.core.states.concurrency_state import ConcurrencyState
from rafcon.core.storage.storage import load_state_machine_from_path

from codra_dsl.integrations.rafcon.annotations import states_within
from codra_dsl.integrations.rafcon.bridge import Answers, Bridge
from codra_dsl.integrations.rafcon.hand_over import HandOver
from codra_dsl.runtime import Clock, ContextManager

LIBRARIES: Mapping[str, Path] = {"codra": Path(__file__).parent / "libraries" / "codra"}
"""A mapping from the root keys of libraries to their folders, in the form of RAFCON's setting LIBRARY_PATHS."""


class MissingLibraryError(LookupError):
    """A state machine uses a library state that no registered library has. The message names the state."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """The end of a state machine.

    Attributes:
        outcome: the name of the root state's outcome; `aborted` and `preempted` are outcomes that RAFCON defines.
        error: the exception of a state that aborted the state machine; None if there is none.
    """

    outcome: str
    error: BaseException | None


@contextmanager
def opened(folder: Path, libraries: Mapping[str, Path] = LIBRARIES) -> Iterator[StateMachine]:
    """Load a state machine that RAFCON saved, and remove it from RAFCON at the end of the `with` statement.

    Args:
        folder: the folder with `statemachine.json`.
        libraries: the libraries that the state machine uses.

    Raises:
        MissingLibraryError: if the state machine uses another library, or a state that its library lacks.
    """
    register(libraries)
    with entered(_load(folder, libraries)) as machine:
        yield machine


def _load(folder: Path, libraries: Mapping[str, Path]) -> StateMachine:
    """Load a state machine. RAFCON asks no questions: it would wait for a user who names the folder of a library."""
    asks_user = library_manager.show_dialog
    library_manager.show_dialog = False
    try:
        return load_state_machine_from_path(str(folder))
    except LibraryNotFoundException as error:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ResourceWarning)  # RAFCON did not close the file that it was reading
            traceback.clear_frames(error.__traceback__)
        root_keys = ", ".join(map(repr, libraries)) or "none"
        help_text = f"add its root key and folder to 'libraries', which has {root_keys}"
        raise MissingLibraryError(f"{folder}: {error}: {help_text}") from error
    finally:
        library_manager.show_dialog = asks_user


@contextmanager
def entered(machine: StateMachine) -> Iterator[StateMachine]:
    """Register a state machine with RAFCON, so that it can run, until the end of the `with` statement."""
    state_machine_manager.add_state_machine(machine)
    try:
        yield machine
    finally:
        state_machine_manager.remove_state_machine(machine.state_machine_id)


def register(libraries: Mapping[str, Path] = LIBRARIES) -> None:
    """Register exactly these libraries with RAFCON, by their root keys, so that their states can be made and loaded."""
    setup_environment()
    global_config.set_config_value("LIBRARY_PATHS", {key: str(path) for key, path in libraries.items()})
    library_manager.initialize()


def run_in_real_time(
    machine: StateMachine,
    codra: ContextManager[Any, Any],
    clock: Clock,
    *,
    handles: Mapping[str, object] | None = None,
    answers: Answers = Answers.CONTEXT,
) -> Ended:
    """Run a state machine whose states decide on context, and wait for its end. Each state runs in its own thread.

    Args:
        machine: an `opened` or `entered` state machine.
        codra: the context manager that its states use.
        clock: the clock of `codra`.
        handles: a mapping from names to global variables for scripts, such as the robot.
        answers: how decisions are answered.

    Raises:
        AnnotationError: if the semantic data of its states is wrong.
        RuntimeError: if another state machine is running: RAFCON has one engine per process.
    """
    _check_idle()
    with Bridge(codra, clock, answers=answers).attached(machine), _global_variables(handles or {}):
        state_machine_execution_engine.start(machine.state_machine_id)
        try:
            state_machine_execution_engine.join()
        except BaseException:
            state_machine_execution_engine.stop()
            state_machine_execution_engine.join()
            raise
    return _end_of(machine)


def run_in_simulated_time(
    machine: StateMachine,
    codra: ContextManager[Any, Any],
    clock: Clock,
    *,
    handles: Mapping[str, object] | None = None,
    answers: Answers = Answers.CONTEXT,
) -> Ended:
    """Run a state machine in simulated time, in the calling thread; the same seed gives the same event log.

    Every use of the context manager by states, and every method call of a handle, runs in this thread, one after the
    other. The arguments are those of `run_in_real_time`.

    Raises:
        AnnotationError: if the semantic data of its states is wrong.
        ValueError: if states of the machine run concurrently.
        RuntimeError: if another state machine is running.
    """
    concurrent_states = [state for state in states_within(machine.root_state) if isinstance(state, ConcurrencyState)]
    if concurrent_states:
        path = concurrent_states[0].get_path()
        raise ValueError(f"{path} runs states concurrently, but simulated time has one thread: use run_in_real_time")
    _check_idle()
    hand_over = HandOver()
    handle_proxies = {name: hand_over.proxy_of(handle) for name, handle in (handles or {}).items()}
    with (
        Bridge(codra, clock, answers=answers, do=hand_over.call).attached(machine),
        _global_variables(handle_proxies),
    ):
        state_machine_execution_engine.start(machine.state_machine_id)
        threading.Thread(target=_end_when_done, args=[hand_over], daemon=True).start()
        try:
            hand_over.serve()
        except BaseException:
            state_machine_execution_engine.stop()
            hand_over.refuse()
            state_machine_execution_engine.join()
            raise
    return _end_of(machine)


@contextmanager
def _global_variables(handles: Mapping[str, object]) -> Iterator[None]:
    """Make handles global variables of RAFCON."""
    for name, handle in handles.items():
        global_variable_manager.set_variable(name, handle, per_reference=True)
    try:
        yield
    finally:
        for name in handles:
            global_variable_manager.delete_variable(name)


def _check_idle() -> None:
    if not state_machine_execution_engine.finished_or_stopped():
        raise RuntimeError(
            "RAFCON is running another state machine, and has one engine per process: wait for its end first"
        )


def _end_when_done(hand_over: HandOver) -> None:
    state_machine_execution_engine.join()
    hand_over.end()


def _end_of(machine: StateMachine) -> Ended:
    root = machine.root_state
    return Ended(outcome=root.final_outcome.name, error=root.output_data.get("error"))
