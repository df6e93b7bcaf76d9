"""The rules of the findings that are reported while a spec is read. Codes are never reused."""

from __future__ import annotations

from codra_dsl.language.diagnostics import Severity, rules

_ERROR, _WARNING = Severity.ERROR, Severity.WARNING

RULES = rules(
    # Limits, reading files
    ("CDR0001", "cannot-read", _ERROR),
    ("CDR0002", "file-too-large", _ERROR),
    ("CDR0003", "nested-too-deeply", _ERROR),
    ("CDR0004", "too-many-values", _ERROR),
    ("CDR0005", "text-too-long", _ERROR),
    ("CDR0006", "too-many-parts", _ERROR),
    ("CDR0007", "no-spec", _ERROR),
    ("CDR0008", "part-without-spec", _ERROR),
    ("CDR0010", "unincluded-part", _WARNING),
    # YAML
    ("CDR1001", "yaml-syntax", _ERROR),
    ("CDR1002", "not-utf-8", _ERROR),
    ("CDR1003", "byte-order-mark", _ERROR),
    ("CDR1004", "control-character", _ERROR),
    ("CDR1005", "duplicate-key", _ERROR),
    ("CDR1006", "tag", _ERROR),
    ("CDR1007", "anchor", _ERROR),
    ("CDR1008", "merge-key", _ERROR),
    ("CDR1009", "directive", _ERROR),
    ("CDR1010", "second-document", _ERROR),
    ("CDR1011", "key-not-text", _ERROR),
    ("CDR1012", "number-out-of-range", _ERROR),
    # YAML: the traps of conditions
    ("CDR1021", "torn-at-comma", _ERROR),
    ("CDR1022", "torn-at-colon", _ERROR),
    ("CDR1023", "cut-off-by-comment", _ERROR),
    ("CDR1024", "read-as-tag", _ERROR),
    ("CDR1025", "read-as-block", _ERROR),
    ("CDR1026", "read-as-quoted", _ERROR),
    ("CDR1027", "read-as-literal", _ERROR),
    ("CDR1028", "read-as-list", _ERROR),
    ("CDR1029", "condition-in-comment", _WARNING),
    # Shape
    ("CDR2001", "not-a-spec", _ERROR),
    ("CDR2002", "language-version", _ERROR),
    ("CDR2003", "unknown-key", _ERROR),
    ("CDR2004", "missing-key", _ERROR),
    ("CDR2005", "wrong-type", _ERROR),
    ("CDR2006", "unknown-value", _ERROR),
    ("CDR2007", "misplaced-key", _ERROR),
    ("CDR2008", "wrong-length", _ERROR),
    ("CDR2009", "repeated-value", _ERROR),
    ("CDR2010", "duration", _ERROR),
    ("CDR2011", "unit", _ERROR),
    ("CDR2012", "range", _ERROR),
    ("CDR2013", "call", _ERROR),
    ("CDR2014", "monitor", _ERROR),
    ("CDR2015", "confirm", _ERROR),
    ("CDR2016", "fuzzy-term", _ERROR),
    ("CDR2017", "ros-name", _ERROR),
    ("CDR2021", "not-a-site", _ERROR),
    # Names of parts, templates and elements
    ("CDR3001", "ill-formed-name", _ERROR),
    ("CDR3002", "reserved-name", _ERROR),
    ("CDR3003", "duplicate-name", _ERROR),
    ("CDR3010", "part-not-found", _ERROR),
    ("CDR3011", "part-outside-project", _ERROR),
    ("CDR3012", "part-includes-itself", _ERROR),
    ("CDR3013", "part-included-twice", _ERROR),
    ("CDR3014", "part-is-spec", _ERROR),
    ("CDR3020", "unknown-template", _ERROR),
    ("CDR3021", "missing-argument", _ERROR),
    ("CDR3022", "unknown-argument", _ERROR),
    ("CDR3023", "ill-typed-argument", _ERROR),
    ("CDR3024", "unused-parameter", _WARNING),
    ("CDR3025", "unknown-parameter", _ERROR),
    ("CDR3026", "ill-formed-parameter", _ERROR),
    ("CDR3027", "parameter-in-name", _ERROR),
    ("CDR3028", "parameter-outside-template", _ERROR),
    ("CDR3030", "call-not-found", _WARNING),
    ("CDR3031", "call-arguments", _WARNING),
    # Topics of ROS 2
    ("CDR3035", "unknown-message-type", _WARNING),
    ("CDR3036", "unknown-message-field", _ERROR),
    ("CDR3037", "ros-without-writer", _ERROR),
    ("CDR4003", "message-type-mismatch", _ERROR),
    # Sites
    ("CDR3032", "site-without-spec", _ERROR),
    ("CDR3033", "not-in-spec", _ERROR),
    ("CDR3034", "two-sites", _ERROR),
    # Conditions
    ("CDR4001", "condition-syntax", _ERROR),
    ("CDR4002", "pattern-syntax", _ERROR),
)
