"""The main execution of the laboratory: P1's sample-processing workflow (section 4) as plain Python.

The robot fetches samples from the centrifuge, lets the PCR-cycler work on them and brings them back. For every decision
it first asks the context manager. If there is no answer, the robot looks by itself, as P1's robot did without
observers.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum

from codra_papers.lab.context import ActingSkill, Context
from codra_papers.lab.robot import Clock, OutOfReachError, Robot, RotorPosition
from codra_papers.lab.sequential_perception import SequentialPerception

CENTRIFUGE = "centrifuge"
PCR_CYCLER = "pcr_cycler"

SKILLS = (
    *(
        f"{verb}_{machine}"
        for machine in (CENTRIFUGE, PCR_CYCLER)
        for verb in ("drive_to", "unlock", "open", "close", "lock")
    ),
    "turn_centrifuge_rotor",
    "take_samples_from_centrifuge",
    "bring_samples_to_centrifuge",
)
"""The skills of the mission: a spec must declare all of them."""

DECISION_VARIABLES = (
    "robot_is_localized",
    *(
        f"{machine}_{property_name}"
        for machine in (CENTRIFUGE, PCR_CYCLER)
        for property_name in ("in_manipulation_distance", "open", "locked")
    ),
    "centrifuge_rotor_in_pos_1",
    "centrifuge_rotor_in_pos_2",
)
"""The context-variables that the mission decides on. All of them are true or false."""

MAX_TRIES = 2
"""How often an action is tried before the mission gives up."""

WAIT_S = 8.0
"""How long the robot waits for observers after an action. A look by the robot itself would take longer."""

_ROTOR_VARIABLES = {RotorPosition.FIRST: "centrifuge_rotor_in_pos_1", RotorPosition.SECOND: "centrifuge_rotor_in_pos_2"}


class MissionError(RuntimeError):
    """The main execution cannot continue. P1, section 4.1, calls this an unrecoverable error."""


class Expect(StrEnum):
    """Whether the main execution announces the next skill in advance."""

    ONE_AHEAD = "one action ahead"
    NOTHING = "nothing"


class Mission:
    """The sample-processing workflow, whose decisions depend on context.

    Attributes:
        loops: how many batches of samples were processed.
    """

    def __init__(
        self,
        robot: Robot,
        perception: SequentialPerception,
        codra: Context,
        clock: Clock,
        expect: Expect = Expect.ONE_AHEAD,
        *,
        wait_s: float = WAIT_S,
    ) -> None:
        """Take command of a robot.

        Args:
            robot: the robot's body.
            perception: looks for a value if context does not know the value.
            codra: the context. If context knows no value at all, the robot looks for every decision, as in P1 without
                observers.
            clock: the clock with which the mission waits.
            expect: whether the mission announces the next skill in advance.
            wait_s: how long the mission waits for observers after an action; 0 without observers.
        """
        self.loops = 0
        self._robot = robot
        self._perception = perception
        self._codra = codra
        self._clock = clock
        self._expect_mode = expect
        self._wait_s = wait_s

    def run_loop(self, *, leave_lid_open: bool = False) -> None:
        """Process one batch of samples, from the centrifuge through the PCR-cycler and back.

        Args:
            leave_lid_open: whether the lid of the centrifuge stays open until the robot comes back to it. The
                PCR-cycler is always closed, because it heats the samples.

        Raises:
            MissionError: a decision did not get the necessary answer, or every try of an action failed.
        """
        try:
            self._process_batch(leave_lid_open=leave_lid_open)
        except OutOfReachError as error:
            raise MissionError(str(error)) from error
        self.loops += 1

    def open_and_close(self, machine: str, times: int, *, leave_open: bool = False) -> None:
        """Drive to a machine, then several times unlock, open, close and lock the machine (P1, section 4.2).

        Args:
            machine: the name of the machine.
            times: how often the machine is opened.
            leave_open: whether the machine stays open after it was opened for the last time.

        Raises:
            MissionError: a decision did not get the necessary answer, or every try of an action failed.
        """
        try:
            self._drive_to(machine)
            for count in range(1, times + 1):
                self.open_machine(machine)
                if count < times or not leave_open:
                    self.close_machine(machine)
        except OutOfReachError as error:
            raise MissionError(str(error)) from error

    def wait_beside(self, machine: str, until_s: float, *, draw_back: bool = False) -> None:
        """Drive to a machine, open it, wait in front of it until an instant, and close it.

        Args:
            machine: the name of the machine.
            until_s: when the robot begins to close the machine.
            draw_back: whether the arm returns to its ready pose before the robot waits. Otherwise the camera stays
                where the last look was taken.

        Raises:
            MissionError: a decision did not get the necessary answer, or every try of an action failed.
        """
        try:
            self._drive_to(machine)
            self.open_machine(machine)
            if draw_back:
                self._robot.draw_back(machine)
            self._clock.sleep(max(until_s - self._clock.now_s(), 0.0))
            self.close_machine(machine)
        except OutOfReachError as error:
            raise MissionError(str(error)) from error

    def _process_batch(self, *, leave_lid_open: bool) -> None:
        self._visit(CENTRIFUGE, self._take_from_centrifuge, leave_open=leave_lid_open)
        self._visit(PCR_CYCLER, lambda: self._bring_samples(PCR_CYCLER))
        self._clock.sleep(self._robot.laboratory.amplification_s)
        self._visit(PCR_CYCLER, lambda: self._take_samples(PCR_CYCLER))
        self._visit(CENTRIFUGE, self._bring_to_centrifuge)

    def _visit(self, machine: str, work_inside: Callable[[], None], *, leave_open: bool = False) -> None:
        """Drive to a machine, open it, work inside, and leave it open, or closed and locked."""
        self._drive_to(machine)
        self.open_machine(machine)
        work_inside()
        if not leave_open:
            self.close_machine(machine)

    def open_machine(self, machine: str) -> None:
        """Unlock and open a machine within reach. This takes four perception tasks, as in P1, section 4.2.

        Before each action the robot checks whether the action is needed (situation preview). After each action the
        robot checks whether the action reached its goal (situation monitoring).

        Raises:
            MissionError: a decision did not get the necessary answer, or every try of an action failed.
            OutOfReachError: the machine is too far away.
        """
        self._unlock(machine)
        self._open(machine)

    def close_machine(self, machine: str) -> None:
        """Close and lock a machine within reach. As in `open_machine`, this takes four perception tasks.

        Raises:
            MissionError: a decision did not get the necessary answer, or every try of an action failed.
            OutOfReachError: the machine is too far away.
        """
        self._close(machine)
        self._lock(machine)

    # Skills. Under the name of each skill, the spec lists the variables that the skill decides on.

    def _drive_to(self, machine: str) -> None:
        with self._codra.skill(f"drive_to_{machine}"):
            self._localize()
            self._expect(f"unlock_{machine}")
            self._robot.drive_to(machine)
            self._localize()

    def _unlock(self, machine: str) -> None:
        with self._codra.skill(f"unlock_{machine}") as skill:
            self._require(f"{machine}_in_manipulation_distance")
            if self._decide(f"{machine}_locked"):
                self._expect(f"open_{machine}")
                self._act(skill, lambda: self._robot.unlock(machine), f"{machine}_locked", goal=False)

    def _open(self, machine: str) -> None:
        with self._codra.skill(f"open_{machine}") as skill:
            self._require(f"{machine}_in_manipulation_distance")
            if not self._decide(f"{machine}_open"):
                self._expect("turn_centrifuge_rotor" if machine == CENTRIFUGE else f"close_{machine}")
                self._act(skill, lambda: self._robot.open_lid(machine), f"{machine}_open", goal=True)

    def _close(self, machine: str) -> None:
        with self._codra.skill(f"close_{machine}") as skill:
            self._require(f"{machine}_in_manipulation_distance")
            if self._decide(f"{machine}_open"):
                self._expect(f"lock_{machine}")
                self._act(skill, lambda: self._robot.close_lid(machine), f"{machine}_open", goal=False)

    def _lock(self, machine: str) -> None:
        with self._codra.skill(f"lock_{machine}") as skill:
            self._require(f"{machine}_in_manipulation_distance")
            if self._decide(f"{machine}_open"):
                raise MissionError(f"{machine}_open is true where it must be false")
            self._act(skill, lambda: self._robot.lock(machine), f"{machine}_locked", goal=True)

    def _turn_rotor(self, position: RotorPosition, next_skill: str) -> None:
        with self._codra.skill("turn_centrifuge_rotor") as skill:
            self._require("centrifuge_open")
            if not self._decide(_ROTOR_VARIABLES[position]):
                self._expect(next_skill)
                self._act(skill, lambda: self._robot.turn_rotor(position), _ROTOR_VARIABLES[position], goal=True)

    def _take_from_centrifuge(self) -> None:
        self._turn_rotor(RotorPosition.FIRST, next_skill="take_samples_from_centrifuge")
        with self._codra.skill("take_samples_from_centrifuge"):
            self._require("centrifuge_open", _ROTOR_VARIABLES[RotorPosition.FIRST])
            self._expect("close_centrifuge")
            self._take_samples(CENTRIFUGE)

    def _bring_to_centrifuge(self) -> None:
        self._turn_rotor(RotorPosition.SECOND, next_skill="bring_samples_to_centrifuge")
        with self._codra.skill("bring_samples_to_centrifuge"):
            self._require("centrifuge_open", _ROTOR_VARIABLES[RotorPosition.SECOND])
            self._expect("close_centrifuge")
            self._bring_samples(CENTRIFUGE)

    def _take_samples(self, machine: str) -> None:
        self._robot.take_samples(machine)
        if not self._robot.is_carrying:
            raise MissionError(f"no samples could be taken from the {machine}")

    def _bring_samples(self, machine: str) -> None:
        self._robot.bring_samples(machine)
        if self._robot.is_carrying:
            raise MissionError(f"the samples could not be put into the {machine}")

    # Acting and deciding

    def _act(self, skill: ActingSkill, action: Callable[[], None], variable: str, *, goal: bool) -> None:
        """Act, then check with evidence from after the action whether the action reached its goal."""
        for _ in range(MAX_TRIES):
            with skill.acting():
                action()
            if self._decide(variable, since_s=self._clock.now_s(), wait_up_to_s=self._wait_s) == goal:
                return
        raise MissionError(f"{variable} is not {str(goal).lower()} after {MAX_TRIES} tries")

    def _decide(self, variable: str, since_s: float = float("-inf"), wait_up_to_s: float = 0.0) -> bool:
        """Return the answer to a yes-or-no decision from context, or from a look if context has no answer."""
        answer = self._codra.decide(
            variable, otherwise=lambda: self._perception.look_for(variable), since_s=since_s, wait_up_to_s=wait_up_to_s
        )
        if answer is None:
            raise MissionError(f"{variable} cannot be seen")
        return bool(answer)

    def _require(self, *variables: str) -> None:
        for variable in variables:
            if not self._decide(variable):
                raise MissionError(f"{variable} is false where it must be true")

    def _expect(self, *skills: str) -> None:
        if self._expect_mode is Expect.ONE_AHEAD:
            self._codra.expect(*skills)

    def _localize(self) -> None:
        """Record whether the robot is localised. If the robot is lost, localise it again."""
        self._codra.set("robot_is_localized", self._robot.is_localized())
        if not self._codra.decide("robot_is_localized", otherwise=self._robot.is_localized):
            self._robot.relocalize()
            self._codra.set("robot_is_localized", self._robot.is_localized())
