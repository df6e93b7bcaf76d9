"""The renewal of the evidence of parameters, which shows that their loop still runs.

The evidence of a parameter is the instant of an analysis that confirmed its value. Not every analysis writes it: it is
written again when half of the validity of the last evidence is over. So the value of a running loop stays valid, the
value of a loop that stopped becomes stale within `valid_for`, and the journal has few entries.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from typing import Any

from codra_dsl.runtime.loops.planning import VariableWrite
from codra_dsl.runtime.values.cell import Override, Reading

_ROUNDING_S = 1e-9


class Renewals:
    """Decides which parameters of one loop are written again.

    Attributes:
        due_s: when the next renewal is due; infinite if none is.
    """

    def __init__(self, writer: str, valid_for_s: Mapping[str, float]) -> None:
        """Begin without any value.

        Args:
            writer: the agent that writes parameters. The value of another writer is not overwritten while it is valid.
            valid_for_s: for the variable of each parameter, how long its evidence is valid.
        """
        self._writer = writer
        self._valid_for_s = {name: valid_for_s for name, valid_for_s in valid_for_s.items() if valid_for_s < math.inf}
        self._last_writes: dict[str, VariableWrite] = {}
        self.due_s = math.inf

    def confirm(self, variable_write: VariableWrite) -> None:
        """Store the value that was written to a parameter."""
        if variable_write.variable in self._valid_for_s:
            self._last_writes[variable_write.variable] = variable_write

    @property
    def variables(self) -> tuple[str, ...]:
        """Return the variables that may be renewed."""
        return tuple(self._last_writes)

    def renew(
        self, readings: Mapping[str, Reading[Any]], unconfirmed: Collection[str], now_s: float
    ) -> Iterator[VariableWrite]:
        """Yield the values that are written again now, and set `due_s`.

        Args:
            readings: the present readings of `variables`.
            unconfirmed: the variables whose values the analysis of this instant did not confirm.
            now_s: the instant of the analysis.
        """
        self.due_s = math.inf
        for name in [name for name in self._last_writes if name not in unconfirmed]:
            renewal_s = self._renewal_s(readings[name], now_s)
            if renewal_s <= now_s + _ROUNDING_S:
                self._last_writes[name] = replace(self._last_writes[name], evidence_s=now_s)
                yield self._last_writes[name]
                renewal_s = now_s + self._valid_for_s[name] / 2
            self.due_s = min(self.due_s, renewal_s)

    def _renewal_s(self, reading: Reading[Any], now_s: float) -> float:
        """Return when a parameter is written again: half of its validity later, or when it has become unknown.

        The value beneath an override is renewed, so that it is valid when the override ends.
        """
        present_reading = (reading.beneath if isinstance(reading, Override) else reading).at(now_s)
        if not present_reading.known:
            return now_s
        if present_reading.source != self._writer:
            return present_reading.expires_s
        return self._last_writes[reading.name].evidence_s + self._valid_for_s[reading.name] / 2
