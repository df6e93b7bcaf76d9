"""Frames as files: a lossless picture, and the other values of the frame as JSON.

Run as a program, this module runs the perception functions on stored frames.

The program loads only perception, so that its output depends only on the files.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from codra_papers.lab.perception import functions as perception
from codra_papers.lab.perception.frame import Frame, Intrinsics
from codra_papers.lab.perception.poses import Pose
from tests.papers.lab.asked import OneFrameCamera, RecordedJob

MACHINES = ("centrifuge", "pcr_cycler")


def store(frame: Frame, picture: Path) -> None:
    """Write a frame's pixels as a PNG file, and its other values as JSON into the same folder."""
    assert cv2.imwrite(str(picture), cv2.cvtColor(frame.pixels, cv2.COLOR_RGB2BGR))
    intrinsics, pose = frame.intrinsics, frame.believed_map_from_camera
    metadata = {
        "intrinsics": {"width": intrinsics.width, "height": intrinsics.height, "focal_px": intrinsics.focal_px},
        "rotation": pose.rotation.tolist(),
        "translation_m": pose.translation_m.tolist(),
        "stamp_s": frame.stamp_s,
    }
    picture.with_suffix(".json").write_text(json.dumps(metadata), "utf-8")


def read_frame(picture: Path) -> Frame:
    """Read a frame that `store` wrote."""
    metadata = json.loads(picture.with_suffix(".json").read_text("utf-8"))
    pixels = cv2.cvtColor(cv2.imread(str(picture), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
    return Frame(
        pixels=np.asarray(pixels, dtype=np.uint8),
        intrinsics=Intrinsics(**metadata["intrinsics"]),
        believed_map_from_camera=Pose(np.array(metadata["rotation"]), np.array(metadata["translation_m"])),
        stamp_s=metadata["stamp_s"],
    )


def perceive(frame: Frame) -> dict[str, Any]:
    """Return all results of perception for a frame, with the evidence and times that it reports."""
    results: dict[str, Any] = {}
    for machine in MACHINES:
        for function in (perception.find_in_view, perception.localize_lid):
            job = RecordedJob()
            results[f"{machine} {function.__name__}"] = dict(
                function(machine=machine, camera=OneFrameCamera(frame), job=job)
            )
            results[f"{machine} {function.__name__} job"] = [list(entry) for entry in job.record]
    results["rotor"] = dict(
        perception.localize_rotor(machine="centrifuge", camera=OneFrameCamera(frame), job=RecordedJob())
    )
    return results


def main() -> None:
    """Print the results of perception for each stored frame of a folder, and whether MuJoCo was loaded."""
    frames = {picture.name: perceive(read_frame(picture)) for picture in sorted(Path(sys.argv[1]).glob("*.png"))}
    print(json.dumps({"frames": frames, "mujoco": "mujoco" in sys.modules}))  # noqa: T201


if __name__ == "__main__":
    main()
