"""Read the tables under `[tool.codra]` of a project's `pyproject.toml`. Errors become findings with a place."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import field
from pathlib import Path

from codra_dsl.language.diagnostics import Diagnostic, Place, Rule, Severity, Span, suggest
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.project import MAX_SETTINGS_BYTES, SETTINGS, parse_settings, settings_in
from codra_dsl.workspace.suppression.rules import RULES, known_rules, nearest_code
from codra_dsl.workspace.suppression.toml_places import Steps, TomlPlaces

_BYTE_ORDER_MARK = "\N{ZERO WIDTH NO-BREAK SPACE}"
_TABLE_PATH = ("tool", "codra", "lint")
_LINT_KEYS = ("select", "ignore", "severity", "fail-on")
_CODRA_KEYS = ("lint", "ros")
_ROS_KEYS = ("messages",)
_CODE_PREFIX = re.compile(r"CDR[0-9]{0,4}")
_POSITION_IN_ERROR = re.compile(r" \(at (?:line (?P<line>\d+), column (?P<column>\d+)|end of document)\)$")
_MAX_SUGGESTIONS = 100
"""The maximum number of searches for a similar name; further findings have no suggestion."""

_SEVERITIES = {severity.value: severity for severity in Severity}


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The findings that a project wants to have reported about its specs.

    If several codes and prefixes match a rule, the longest of them decides. If the same code or prefix is in `select`
    and in `ignore`, `ignore` decides.

    Attributes:
        select: codes and prefixes of findings that are reported.
        ignore: codes and prefixes of findings that are not reported.
        severity: for a code or prefix, the severity that replaces the severity of the rule.
        fail_on: the lowest severity that makes a command fail.
    """

    select: tuple[str, ...] = ("CDR",)
    ignore: tuple[str, ...] = ()
    severity: Mapping[str, Severity] = field(default_factory=dict)
    fail_on: Severity = Severity.ERROR

    def selects(self, rule: Rule) -> bool:
        """Return whether findings of a rule are reported; findings of a binding rule are always reported."""
        return rule.is_binding or _longest_match_length(self.select, rule.code) > _longest_match_length(
            self.ignore, rule.code
        )

    def level(self, rule: Rule) -> Severity:
        """Return the severity of findings of a rule; findings of a binding rule are always errors."""
        if rule.is_binding:
            return rule.severity
        matching_prefixes = [prefix for prefix in self.severity if rule.code.startswith(prefix)]
        return self.severity[max(matching_prefixes, key=len)] if matching_prefixes else rule.severity


def _longest_match_length(prefixes: Iterable[str], code: str) -> int:
    return max((len(prefix) for prefix in prefixes if code.startswith(prefix)), default=-1)


def settings_of(root: Path) -> tuple[Settings, tuple[Diagnostic, ...]]:
    """Return the valid part of a project's settings, and the findings about the rest."""
    data = settings_in(root)
    if data is None:
        return Settings(), ()
    if len(data) > MAX_SETTINGS_BYTES:
        return Settings(), (_unreadable_finding(f"it has more than {MAX_SETTINGS_BYTES >> 10} KiB", 1, 1),)
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        text_before = data[: error.start].decode("utf-8", "replace")
        line, column = text_before.count("\n") + 1, len(text_before) - text_before.rfind("\n")
        return Settings(), (_unreadable_finding(f"the byte 0x{data[error.start]:02x} is not UTF-8", line, column),)
    if text.startswith(_BYTE_ORDER_MARK):
        return Settings(), (_unreadable_finding("it begins with a byte order mark, which is invisible", 1, 1),)
    try:
        document = parse_settings(text)
    except ValueError as error:
        return Settings(), (_toml_finding(str(error), text),)
    except RecursionError:
        return Settings(), (_unreadable_finding("it is nested too deeply", 1, 1),)
    reader = _SettingsReader(document, text)
    return reader.settings(), tuple(reader.diagnostics)


def _toml_finding(toml_error: str, text: str) -> Diagnostic:
    position_match = _POSITION_IN_ERROR.search(toml_error)
    problem = toml_error[: position_match.start()] if position_match else toml_error
    if position_match is None or position_match["line"] is None:
        return _unreadable_finding(problem, text.count("\n") + 1, len(text) - text.rfind("\n"))
    return _unreadable_finding(problem, int(position_match["line"]), int(position_match["column"]))


def _unreadable_finding(problem: str, line: int, column: int) -> Diagnostic:
    return Diagnostic(
        rule=RULES["unreadable-settings"],
        message=f"'{SETTINGS}' cannot be read: {problem}",
        place=Place(Span(SETTINGS, line, column, line, column)),
        path="tool.codra",
        help="correct the file at this place; a key may occur only once in a table",
    )


class _SettingsReader:
    """Reads the settings from a document.

    Attributes:
        diagnostics: the findings about the settings.
    """

    def __init__(self, document: Mapping[str, object], text: str) -> None:
        self.diagnostics: list[Diagnostic] = []
        self._places = TomlPlaces(SETTINGS, text)
        self._suggestions_left = _MAX_SUGGESTIONS
        tool = document.get("tool")
        self._codra = tool.get("codra", {}) if isinstance(tool, dict) else {}

    def settings(self) -> Settings:
        """Return the valid part of the settings."""
        codra = self._table(self._codra, _CODRA_KEYS, _TABLE_PATH[:2])
        self._check_ros(self._table(codra.get("ros", {}), _ROS_KEYS, (*_TABLE_PATH[:2], "ros")))
        lint = self._table(codra.get("lint", {}), _LINT_KEYS, _TABLE_PATH)
        codes = {key: self._codes(key, lint[key]) for key in ("select", "ignore") if key in lint}
        self._report_contradictions(codes)
        severity = self._severities(lint.get("severity", {}))
        fail_on = self._severity("'fail-on'", lint["fail-on"], "fail-on") if "fail-on" in lint else None
        return Settings(
            select=codes.get("select", ("CDR",)),
            ignore=codes.get("ignore", ()),
            severity=severity,
            fail_on=fail_on or Severity.ERROR,
        )

    def _add_finding(self, rule: str, message: str, help: str, place: Place, *steps: str | int) -> None:
        path = ".".join(map(str, steps))
        self.diagnostics.append(Diagnostic(rule=RULES[rule], message=message, place=place, path=path, help=help))

    def _report_wrong_setting(self, message: str, help: str, steps: Steps) -> None:
        self._add_finding("wrong-setting", message, help, self._places.value(*steps), *steps)

    def _table(self, table: object, known_keys: Iterable[str], steps: Steps) -> Mapping[str, object]:
        """Return a table, or an empty one if the value is not a table, and report unknown keys."""
        header = f"[{'.'.join(map(str, steps))}]"
        if not isinstance(table, dict):
            self._report_wrong_setting(f"{header} must be a table", f"write {header} on a line of its own", steps)
            return {}
        for key in table:
            if key not in known_keys:
                suggestion = self._suggest_key(key.replace("_", "-"), known_keys)
                help = f"did you mean '{suggestion}'?" if suggestion else f"the known keys are {', '.join(known_keys)}"
                message = f"unknown key '{key}' in {header}"
                self._add_finding("unknown-setting", message, help, self._places.key(*steps, key), *steps, key)
        return table

    def _check_ros(self, table: Mapping[str, object]) -> None:
        """Report folders of messages that are no list of texts; `language.load.message_types` reads the folders."""
        folders = table.get("messages", [])
        if not isinstance(folders, list) or not all(isinstance(folder, str) for folder in folders):
            steps = (*_TABLE_PATH[:2], "ros", "messages")
            self._report_wrong_setting("'messages' must be a list of folders", 'write messages = ["src"]', steps)

    def _suggest_key(self, key: str, known_keys: Iterable[str]) -> str | None:
        return key if key in known_keys else self._limited(lambda: suggest(key, known_keys))

    def _limited(self, search: Callable[[], str | None]) -> str | None:
        """Return the result of a search for a similar name; None after _MAX_SUGGESTIONS searches."""
        self._suggestions_left -= 1
        return search() if self._suggestions_left >= 0 else None

    def _codes(self, key: str, value: object) -> tuple[str, ...]:
        """Return the valid codes and prefixes in a list."""
        if not isinstance(value, list):
            self._report_wrong_setting(
                f"'{key}' must be a list of codes", f'write {key} = ["CDR7102"]', (*_TABLE_PATH, key)
            )
            return ()
        valid_codes: list[str] = []
        for index, code in enumerate(value):
            steps = (*_TABLE_PATH, key, index)
            if isinstance(code, str) and code in valid_codes:
                place = self._places.value(*steps)
                self._add_finding(
                    "repeated-code", f"'{code}' occurs twice in '{key}'", "remove one of them", place, *steps
                )
            elif self._is_allowed_code(code, steps, forbidden_use="ignored" if key == "ignore" else ""):
                valid_codes.append(str(code))
        return tuple(valid_codes)

    def _is_allowed_code(self, code: object, steps: Steps, *, forbidden_use: str) -> bool:
        """Return whether a value is an allowed code or prefix, and report any other value.

        Args:
            code: the value.
            steps: the path of the value in the document.
            forbidden_use: the use that codes of binding errors do not allow, such as `ignored`; empty for none.
        """
        if not isinstance(code, str):
            self._report_wrong_setting("a code must be a text", 'write "CDR7102", or a prefix such as "CDR71"', steps)
            return False
        matching_rules = [rule for known_code, rule in known_rules().items() if known_code.startswith(code)]
        place = self._places.value(*steps) if isinstance(steps[-1], int) else self._places.key(*steps)
        if not matching_rules or not _CODE_PREFIX.fullmatch(code):
            suggestion = self._limited(lambda: nearest_code(code))
            help = (
                f"did you mean '{suggestion}'?"
                if suggestion
                else "a code is CDR and four digits; a prefix is its beginning"
            )
            self._add_finding("unknown-code-in-settings", f"there is no code '{code}'", help, place, *steps)
            return False
        if forbidden_use and all(rule.is_binding for rule in matching_rules):
            is_complete_code = len(code) == len("CDR0000")
            subject_text = (
                f"'{code}' is an error that prevents" if is_complete_code else f"'{code}' are errors that prevent"
            )
            message = f"{subject_text} compiling, and cannot be {forbidden_use}"
            self._add_finding("binding-code-in-settings", message, "remove the code; correct the spec", place, *steps)
            return False
        return True

    def _report_contradictions(self, codes_of_keys: Mapping[str, tuple[str, ...]]) -> None:
        code_counts = Counter(code for codes in codes_of_keys.values() for code in codes)
        for index, code in enumerate(codes_of_keys.get("ignore", ())):
            if code_counts[code] > 1:
                place = self._places.value(*_TABLE_PATH, "ignore", index)
                message = f"'{code}' is in both 'select' and 'ignore', and 'ignore' wins"
                self._add_finding("repeated-code", message, "remove one of them", place, *_TABLE_PATH, "ignore", index)

    def _severities(self, value: object) -> dict[str, Severity]:
        if not isinstance(value, dict):
            help = 'write severity = {CDR7102 = "error"}'
            self._report_wrong_setting(
                "'severity' must be a table from codes to severities", help, (*_TABLE_PATH, "severity")
            )
            return {}
        return dict(self._valid_severities(value))

    def _valid_severities(self, table: Mapping[str, object]) -> Iterator[tuple[str, Severity]]:
        for code, value in table.items():
            severity = self._severity(f"the severity of '{code}'", value, "severity", code)
            forbidden_use = "lowered" if severity is Severity.WARNING else ""
            if severity is not None and self._is_allowed_code(
                code, (*_TABLE_PATH, "severity", code), forbidden_use=forbidden_use
            ):
                yield code, severity

    def _severity(self, subject_text: str, value: object, *steps: str) -> Severity | None:
        if isinstance(value, str) and value in _SEVERITIES:
            return _SEVERITIES[value]
        suggestion = suggest(value, _SEVERITIES) if isinstance(value, str) else None
        help = (
            f"did you mean '{suggestion}'?"
            if suggestion
            else 'write "error" or "warning"; to hide findings, use \'ignore\''
        )
        value_text = f"'{value}'" if isinstance(value, str) else f"a {type(value).__name__}"
        self._report_wrong_setting(f"{subject_text} cannot be {value_text}", help, (*_TABLE_PATH, *steps))
        return None
