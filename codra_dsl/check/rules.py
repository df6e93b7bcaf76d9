"""The kinds of finding that `check` makes, and the one way to make one."""

from __future__ import annotations

from codra_dsl.diagnostics import Diagnostic, Fix, Place, Related, Severity, rules

_ERROR, _WARNING = Severity.ERROR, Severity.WARNING

RULES = rules(
    ("CDR3101", "unknown-variable", _ERROR),
    ("CDR3102", "unknown-resource", _ERROR),
    ("CDR3103", "unknown-source", _ERROR),
    ("CDR3104", "unknown-returned-value", _ERROR),
    ("CDR3105", "wrong-kind-of-name", _ERROR),
    ("CDR3106", "name-out-of-sight", _ERROR),
    ("CDR3107", "reserved-agent", _ERROR),
    ("CDR3108", "ambiguous-argument", _ERROR),
    ("CDR3109", "unidentified-variable", _ERROR),
    ("CDR3110", "observer-is-no-source", _ERROR),
    ("CDR3111", "same-rank", _ERROR),
    ("CDR3112", "incomplete-first-alternative", _ERROR),
    ("CDR3113", "observer-without-algorithm", _ERROR),
    ("CDR3114", "observer-splits-tree", _ERROR),
    ("CDR3115", "observer-mixes-trees", _ERROR),
    ("CDR3116", "variable-in-two-observers", _ERROR),
    ("CDR3117", "observer-name-taken", _ERROR),
    ("CDR3121", "unknown-node-type", _ERROR),
    ("CDR3122", "unknown-node", _ERROR),
    ("CDR3123", "unknown-edge", _ERROR),
    ("CDR3124", "unknown-attribute", _ERROR),
    ("CDR3125", "unknown-knowledge", _ERROR),
    ("CDR3126", "reserved-in-knowledge", _ERROR),
    ("CDR3127", "two-owners", _ERROR),
    ("CDR3128", "unwritten-knowledge", _ERROR),
    ("CDR3129", "foreign-write", _ERROR),
    ("CDR3130", "claimed-task", _ERROR),
    ("CDR3131", "unattended-task", _ERROR),
    ("CDR4101", "not-a-condition", _ERROR),
    ("CDR4102", "wrong-operand", _ERROR),
    ("CDR4103", "mismatched-types", _ERROR),
    ("CDR4104", "mismatched-units", _ERROR),
    ("CDR4105", "missing-unit", _ERROR),
    ("CDR4106", "unknown-member", _ERROR),
    ("CDR4107", "misplaced-age", _ERROR),
    ("CDR4108", "misplaced-known", _ERROR),
    ("CDR4109", "wrong-value-identified", _ERROR),
    ("CDR4110", "wrong-range", _ERROR),
    ("CDR4111", "commanded-resource", _ERROR),
    ("CDR4112", "misused-resource", _ERROR),
    ("CDR4121", "wrong-ends", _ERROR),
    ("CDR4122", "wrong-starting-value", _ERROR),
    ("CDR5101", "cycle", _ERROR),
    ("CDR5102", "never-runs", _ERROR),
    ("CDR5121", "two-parents", _ERROR),
    ("CDR5122", "frame-cycle", _ERROR),
    ("CDR5123", "waiting-loops", _ERROR),
    ("CDR5124", "unreachable-rule", _ERROR),
    ("CDR5125", "contradictory-rule", _ERROR),
    ("CDR7101", "unnoticed-precondition", _ERROR),
    ("CDR7102", "unreached-variable", _WARNING),
    ("CDR7103", "decision-without-observer", _WARNING),
    ("CDR7104", "unwatched-monitor", _WARNING),
    ("CDR7105", "never-holds", _WARNING),
    ("CDR7106", "always-holds", _WARNING),
    ("CDR7107", "excluded-preview", _WARNING),
    ("CDR7108", "stale-before-renewed", _WARNING),
    ("CDR7109", "oversubscribed-slot", _WARNING),
    ("CDR7110", "unreached-observer", _WARNING),
    ("CDR7111", "unused-resource", _WARNING),
    ("CDR7112", "unused-agent", _WARNING),
    ("CDR7113", "unused-template", _WARNING),
    ("CDR7114", "shadowed-name", _WARNING),
    ("CDR7115", "same-label", _WARNING),
    ("CDR7116", "ineffective-on-event", _WARNING),
    ("CDR7117", "unused-type", _WARNING),
    # CDR8101 to CDR8105 had meanings, and no code is ever used again
)
"""All rules by name."""


def finding(
    rule: str,
    message: str,
    place: Place,
    *,
    path: str,
    way_out: str,
    related: tuple[Related, ...] = (),
    fix: Fix | None = None,
) -> Diagnostic:
    """Return a finding of the named rule; `path` starts with the section and the name of the element."""
    return Diagnostic(rule=RULES[rule], message=message, place=place, path=path, help=way_out, related=related, fix=fix)
