"""The requirement of this distribution on `codra-dsl`, for the tools that build it."""

from __future__ import annotations

from hatchling.metadata.plugin.interface import MetadataHookInterface


class PairedDistribution(MetadataHookInterface):
    """Requires the version of `codra-dsl` that the same release has, because only these two are tested together.

    A version between two releases changes with each commit, so a clone from which `codra-dsl` was installed earlier
    has another one. Then any version is accepted.
    """

    def update(self, metadata: dict[str, object]) -> None:
        """Add the requirements, which are in the settings of this hook, to the metadata."""
        version = str(metadata["version"])
        is_release = ".dev" not in version and "+" not in version
        product = f"codra-dsl=={version}" if is_release else "codra-dsl"
        metadata["dependencies"] = [product, *self.config["dependencies"]]
