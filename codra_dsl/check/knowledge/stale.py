"""Phase 5 for poses: those that conditions trust go stale when nobody reports them any more."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.check.knowledge.mentions import names_read, patterns
from codra_dsl.check.knowledge.owners import is_whole
from codra_dsl.check.knowledge.world import Thing
from codra_dsl.check.mentions import user_of
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import Faults, Scope
from codra_dsl.diagnostics import Diagnostic, Place, Related
from codra_dsl.expression import names_in, reads_of


def unnoticed_poses(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """An edge that somebody writes and by which conditions find where nodes stand says how long a pose stands."""
    if not is_whole(scope, faults):
        return
    trusted: dict[str, Related] = {}
    for user, name, place in _asked(scope):
        _, first, second = reads_of(name)
        for between in scope.world.between(first, second):
            trusted.setdefault(between, Related(f"{user} trusts it", place))
    for name, related in trusted.items():
        edge = scope.world.edges[name]
        stands = edge.motion is None or edge.motion.is_static or edge.motion.valid_for_s is not None
        if not stands and scope.world.writers(Thing("edges", name)):
            yield finding(
                "unnoticed-pose",
                f"edge '{name}' would keep its last pose unnoticed when nobody reports another one",
                edge.place,
                path=f"knowledge.edges.{name}",
                way_out="state 'valid_for', be it 'valid_for: forever', or 'static: true' for what stays as it is put",
                related=(related,),
            )


def _asked(scope: Scope) -> Iterator[tuple[str, str, Place]]:
    """Yield what conditions ask of poses, with who asks and where."""
    for posed in (each.posed for each in scope.spec.context if each.posed is not None):
        section, element, _ = posed.owner
        for name in names_in(posed.tree):
            yield user_of(section, element), name.name, posed.said.place_of(name)
    for pattern in patterns(scope):
        for name in names_read(pattern):
            if reads_of(name.name)[0]:
                yield pattern.user, name.name, pattern.said.place_of(name)


TRUSTED_POSES = (unnoticed_poses,)
"""The rules of this subject."""
