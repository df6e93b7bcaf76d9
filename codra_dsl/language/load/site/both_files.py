"""Findings that concern a spec and a site name the places in both files."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise

from codra_dsl.language.diagnostics import Diagnostic, Related
from codra_dsl.language.model import Site, Spec

MAX_NAMED = 3
"""The maximum number of values of a site that a finding about the spec names."""


_QUOTED_NAME = re.compile(r"'(\w+)(?=')")


def name_both_files(
    diagnostics: Iterable[Diagnostic], spec_diagnostics: Iterable[Diagnostic], spec: Spec
) -> Iterator[Diagnostic]:
    """Yield the findings about a spec with a site. Those that the site causes name the places in both files.

    A finding about a value of the site names the place of the value in the spec. A finding about the spec that the spec
    alone does not have names the values of the site that are its probable cause.

    Args:
        diagnostics: the findings about the spec with the site.
        spec_diagnostics: the findings about the spec alone.
        spec: the spec with the site.
    """
    site = spec.site
    assert site is not None
    findings_of_spec = set(spec_diagnostics)
    for diagnostic in diagnostics:
        files = {place.span.file for place in (diagnostic.place, *(related.place for related in diagnostic.related))}
        if diagnostic in findings_of_spec:
            related: tuple[Related, ...] = ()
        elif diagnostic.place.span.file == site.file:
            related = tuple(_places_in_spec(diagnostic, site))
        else:
            related = () if site.file in files else tuple(_values_of_site(diagnostic, spec, site))
        yield replace(diagnostic, related=(*diagnostic.related, *related)) if related else diagnostic


def _places_in_spec(diagnostic: Diagnostic, site: Site) -> Iterator[Related]:
    """Yield the place in the spec of the value of a site that a finding is about.

    An argument that the template does not have has no place in the spec.
    """
    value = site.replacement_around(diagnostic.place)
    if value is not None and value.replaced is None and diagnostic.rule.name != "unknown-argument":
        yield Related("the spec leaves this value out", value.element)
    elif value is not None and value.replaced is not None:
        yield Related("it replaces this value of the spec", value.replaced)


def _values_of_site(diagnostic: Diagnostic, spec: Spec, site: Site) -> Iterator[Related]:
    """Yield the values of a site that probably cause a finding about the spec.

    These are the values of elements that the finding concerns or names, then the arguments in the place of the finding.
    If there are none, all values are possible.
    """
    path, named = diagnostic.path.split("."), {*_QUOTED_NAME.findall(f"{diagnostic.message} {diagnostic.help}")}
    elements = {*pairwise(path)}
    values = [
        value
        for name in named.union(path)
        for value in site.replacements_of.get(name, ())
        if name in named or (value.section, name) in elements
    ]
    causes = sorted(values, key=lambda value: value.place) or spec.site_arguments(diagnostic.place) or site.replacements
    return (Related("only with this value of the site", value.place) for value in causes[:MAX_NAMED])
