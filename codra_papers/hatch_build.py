"""The requirement of this distribution on `codra-dsl`, for the tools that build it."""

from __future__ import annotations

from hatchling.metadata.plugin.interface import MetadataHookInterface


class PairedDistribution(MetadataHookInterface):
    """Requires the version of `codra-dsl` that the same commit has, because only these two are tested together."""

    def update(self, metadata: dict[str, object]) -> None:
        """Add the requirements, which are in the settings of this hook, to the metadata."""
        metadata["dependencies"] = [f"codra-dsl=={metadata['version']}", *self.config["dependencies"]]
