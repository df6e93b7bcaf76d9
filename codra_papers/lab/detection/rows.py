"""The rows of the map of detection error."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One cell of the map.

    Attributes:
        about: "tag" for one tag by distance and angle; "lid" for a lid's angle by the number of tags of base and lid.
        distance_m: of the camera from the tag; for lids from the nearest and to the farthest of the group.
        angle_deg: between the tag's normal and the line of sight, 0 from straight before it; empty for lids.
        markers: how many tags the lid's angle rests on; empty for tags.
        samples: frames that show the tag whole, frames that give the lid's angle.
        found_share: of these frames, in how many the tag was found; empty for lids.
        error_median: of a corner in px, of a lid's angle in rad.
        error_p95: below it lie 95 % of the errors.
        wrong_side_share: of lids' angles, how many are off by more than 0.3 rad; empty for tags.
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
