"""The rows of the map of detection error."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One cell of the map.

    Attributes:
        about: "tag" for one tag by distance and angle; "lid" for a lid's angle by the number of tags of base and lid.
        distance_m: distance of the camera from the tag; for lids the nearest and the farthest of the group.
        angle_deg: angle between the tag's normal and the line of sight, 0 from straight ahead; empty for lids.
        markers: number of tags that the lid's angle is computed from; empty for tags.
        samples: number of frames that show the complete tag, or that give the lid's angle.
        found_share: share of these frames in which the tag was detected; empty for lids.
        error_median: median error of a corner in px, of a lid's angle in rad.
        error_p95: 95 % of the errors lie below it.
        wrong_side_share: share of lids' angles that are wrong by more than 0.3 rad; empty for tags.
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
