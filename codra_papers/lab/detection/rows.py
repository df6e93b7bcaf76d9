"""The rows of the map of detection error."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class MapRow:
    """One cell of the map.

    Attributes:
        about: "tag" for the measurement of single tags, by distance and viewing angle; "lid" for the measurement of a
            lid's angle, by distance and the number of tags on base and lid.
        machine: the name of the machine.
        distance_m: the distance of the camera from the tag; for lids, the smallest and the largest distance of the
            group.
        angle_deg: the angle between the tag's normal and the line of sight, 0 if the tag is seen exactly from the
            front; empty for lids.
        markers: the number of tags from which the lid's angle is computed; empty for tags.
        samples: the number of frames that show the complete tag, or that give the lid's angle.
        found_share: the share of these frames in which the tag was detected; empty for lids.
        error_median: the median error: for tags the error of the worst corner in px, for lids that of the angle in rad.
        error_p95: 95 % of the errors lie below this value.
        wrong_side_share: the share of the lids' angles that are wrong by more than 0.3 rad; empty for tags.
    """

    about: str
    machine: str
    distance_m: str
    angle_deg: int | None
    markers: int | None
    samples: int
    found_share: float | None
    error_median: float | None
    error_p95: float | None
    wrong_side_share: float | None
