"""Reviews as text for people, as one line per change, as Markdown, as annotations on GitHub, and as JSON.

Text from specs is escaped, so that no command for a terminal or a workflow is executed, and no Markdown is interpreted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from codra_dsl.language.diagnostics import Diagnostic, Place, Rule, Severity, Span
from codra_dsl.language.frozen import dataclass
from codra_dsl.tooling.diff import Change, Latency, Level, Review
from codra_dsl.tooling.report.findings import PLAIN, Palette, as_json, as_markdown, range_of, span_text, visible_text
from codra_dsl.tooling.report.github import render_github

ShowFile = Callable[[str], str]
"""Returns the name under which a file is shown. For a file in a revision, this name contains the revision."""

_ALLOWED_WORD = "allowed"
_MAX_ROWS = 200


@dataclass(frozen=True, slots=True, kw_only=True)
class Versions:
    """The compared versions.

    Attributes:
        before: the name of A on the command line.
        after: the name of B on the command line.
        show_file_before: returns the name under which a file of A is shown.
        show_file_after: returns the name under which a file of B is shown.
    """

    before: str
    after: str
    show_file_before: ShowFile
    show_file_after: ShowFile


def render_full(review: Review, versions: Versions, palette: Palette = PLAIN) -> str:
    """Return each change with its values and places in A and B."""
    paragraphs = ["\n".join(_paragraph_lines(change, versions, palette)) + "\n" for change in review.changes]
    paragraphs += ["\n".join(_latency_lines(review.latencies)) + "\n"] if review.latencies else []
    return "\n".join([*paragraphs, _verdict_line(review) + "\n"])


def render_concise(review: Review, versions: Versions, palette: Palette = PLAIN) -> str:
    """Return one line per change, then the verdict."""
    lines = [_change_line(change, versions, palette) for change in review.changes]
    return "".join(f"{line}\n" for line in [*lines, _verdict_line(review)])


def render_markdown(review: Review, versions: Versions) -> str:
    """Return a review as Markdown, for a comment on a pull request."""
    versions_text = f"{as_markdown(versions.before)} → {as_markdown(versions.after)}"
    lines = [f"### codra diff: {review.verdict}", "", f"{versions_text}: {_counts_text(review) or 'no difference'}", ""]
    for level in Level:
        level_changes = [change for change in review.changes if change.level is level]
        if level_changes:
            lines += [f"**{level}**", "", "| category | element | change | place |", "| --- | --- | --- | --- |"]
            lines += [_row(change, versions) for change in level_changes[:_MAX_ROWS]]
            lines += ["", f"and {len(level_changes) - _MAX_ROWS} more", ""] if len(level_changes) > _MAX_ROWS else [""]
    if review.latencies:
        lines += ["**worst time from declared to known**", "", "| variable | before | after |", "| --- | --- | --- |"]
        lines += [
            f"| {as_markdown(latency.element)} | {latency.before_s:.10g} s | {latency.after_s:.10g} s |"
            for latency in review.latencies[:_MAX_ROWS]
        ]
    return "\n".join(lines).rstrip("\n") + "\n"


def render_annotations(review: Review, folder: str = "") -> str:
    """Return a review as workflow commands of GitHub. Compatible and allowed changes are only written to the log.

    Args:
        review: the review.
        folder: the folder of the project within the repository.
    """
    annotated_changes = (
        change for change in review.changes if change.level is not Level.COMPATIBLE and not change.is_allowed
    )
    commands_text = render_github([_finding_of(change) for change in annotated_changes], folder)
    plain_versions = Versions(before="", after="", show_file_before=str, show_file_after=str)
    logged_changes = (change for change in review.changes if change.level is Level.COMPATIBLE or change.is_allowed)
    log_text = "".join(f"./{_change_line(change, plain_versions, PLAIN)}\n" for change in logged_changes)
    return f"{commands_text}{log_text}{_verdict_line(review)}\n"


def render_json(review: Review, versions: Versions) -> str:
    """Return a review as one JSON object."""
    review_object = {
        "verdict": review.verdict.value,
        "before": versions.before,
        "after": versions.after,
        "counts": _counts(review),
        "changes": [_change_object(change, versions) for change in review.changes],
        "latencies": [
            {"element": latency.element, "before_s": latency.before_s, "after_s": latency.after_s}
            for latency in review.latencies
        ],
    }
    return as_json(review_object, indent=2) + "\n"


def _paragraph_lines(change: Change, versions: Versions, palette: Palette) -> Iterator[str]:
    yield f"{_headline(change, palette)}: {palette.place}{visible_text(change.element)}{palette.end}"
    yield f"  {visible_text(change.message)}"
    value_rows = (
        ("was", change.old_text, _place_text(change.old_place, versions.show_file_before)),
        ("is", change.new_text, _place_text(change.new_place, versions.show_file_after)),
    )
    width = max(len(visible_text(value or "")) for _, value, _ in value_rows)
    for word, value, place in value_rows:
        if place or value is not None:
            text = f"{visible_text(value or ''):{width}}  " if width else ""
            yield f"    {word:3} {text}{palette.gutter}{place}{palette.end}".rstrip()


def _change_line(change: Change, versions: Versions, palette: Palette) -> str:
    place = _place_of_change(change, versions)
    place_text = f"{palette.place}{place}{palette.end}: " if place else ""
    return f"{place_text}{_headline(change, palette)}: {visible_text(change.element)}: {visible_text(change.text)}"


def _headline(change: Change, palette: Palette) -> str:
    colours = {Level.BREAKING: palette.error, Level.CAUTION: palette.warning, Level.COMPATIBLE: palette.help}
    level = _ALLOWED_WORD if change.is_allowed else change.level.value
    colour = palette.gutter if change.is_allowed else colours[change.level]
    return f"{colour}{level}[{change.category}]{palette.end}"


def _place_of_change(change: Change, versions: Versions) -> str:
    new_place_text = _place_text(change.new_place, versions.show_file_after)
    return new_place_text or _place_text(change.old_place, versions.show_file_before)


def _place_text(place: Place | None, show_file: ShowFile) -> str:
    if place is None:
        return ""
    use_text = "" if place.use is None else f" (used in {visible_text(show_file(place.use.file))}:{place.use.line})"
    return f"{span_text(replace(place.span, file=show_file(place.span.file)))}{use_text}"


def _latency_lines(latencies: Sequence[Latency]) -> Iterator[str]:
    yield "worst time from declared to known"
    for latency in latencies:
        yield f"  {visible_text(latency.element)}: was {latency.before_s:.10g} s, is {latency.after_s:.10g} s"


def _verdict_line(review: Review) -> str:
    counts_text = _counts_text(review)
    return f"verdict: {review.verdict}{f' ({counts_text})' if counts_text else ''}"


def _counts(review: Review) -> dict[str, int]:
    counts = Counter(_ALLOWED_WORD if change.is_allowed else change.level.value for change in review.changes)
    return {name: counts[name] for name in (*(level.value for level in Level), _ALLOWED_WORD)}


def _counts_text(review: Review) -> str:
    return ", ".join(f"{count} {name}" for name, count in _counts(review).items() if count)


def _row(change: Change, versions: Versions) -> str:
    category = f"{change.category} ({_ALLOWED_WORD})" if change.is_allowed else f"{change.category}"
    place = as_markdown(_place_of_change(change, versions))
    return f"| {category} | {as_markdown(change.element)} | {as_markdown(change.text)} | {place} |"


def _finding_of(change: Change) -> Diagnostic:
    """Return a change as a finding, from which annotations are rendered."""
    severity = Severity.ERROR if change.level is Level.BREAKING else Severity.WARNING
    place = change.new_place or change.old_place or Place(Span("-", 1, 1, 1, 1))
    rule = Rule(code="codra diff", name=change.category.value, severity=severity)
    return Diagnostic(rule=rule, message=f"{change.element}: {change.text}", place=Place(place.span))


def _change_object(change: Change, versions: Versions) -> dict[str, object]:
    return {
        "category": change.category.value,
        "level": change.level.value,
        "spec": change.spec,
        "element": change.element,
        "key": change.key,
        "message": change.message,
        "allowed": change.is_allowed,
        "was": change.old_text,
        "is": change.new_text,
        "before": _range_object(change.old_place, versions.show_file_before),
        "after": _range_object(change.new_place, versions.show_file_after),
    }


def _range_object(place: Place | None, show_file: ShowFile) -> dict[str, object] | None:
    return None if place is None else range_of(replace(place.span, file=show_file(place.span.file)))
