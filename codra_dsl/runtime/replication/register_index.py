"""Which registers belong to a node, so that a write does not cost more in a larger graph."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

from codra_dsl.runtime.replication.commits import Register, RegisterKind
from codra_dsl.runtime.replication.merge import MergedState


class RegisterIndex:
    """The registers by their node; for an edge, this is its origin. It can also have registers that no longer exist."""

    def __init__(self) -> None:
        """Create an empty index."""
        self._registers_by_node: defaultdict[str, dict[Register, None]] = defaultdict(dict)

    def add(self, registers: Iterable[Register]) -> None:
        """Add registers."""
        for register in registers:
            self._registers_by_node[register.path[0]][register] = None

    def replace(self, registers: Iterable[Register]) -> None:
        """Replace all registers."""
        self._registers_by_node.clear()
        self.add(registers)

    def registers_of(self, merged: MergedState, names: Iterable[str]) -> list[Register]:
        """Return the registers that determine some nodes, their ancestors by pose, and the edges between all of these.

        An ancestor is needed because a pose counts only if it closes no cycle.
        """
        registers: list[Register] = []
        pending_names, seen_names = list(names), set[str]()
        while pending_names:
            name = pending_names.pop()
            if name in seen_names:
                continue
            seen_names.add(name)
            for register in self._registers_by_node.get(name, ()):
                registers.append(register)
                if register.kind is RegisterKind.POSE:
                    entries = merged.registers.get(register) or ()
                    pending_names.extend(entry.content[0] for entry in entries if entry.content is not None)
        return registers
