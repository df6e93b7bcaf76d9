"""A simulated kitchen, as examples/kitchen/perception.py sees it."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class Kitchen:
    """A simulated kitchen: the part of it that a robot could see."""

    robot_m: float = 0.0
    place_m: dict[str, float] = field(default_factory=lambda: {"fridge": 0.5, "dishwasher": 3.0})
    angle_rad: dict[str, float | None] = field(default_factory=lambda: {"fridge": 0.0, "dishwasher": 0.0})
    edges: int = 10
    kettle_bearing_rad: float = 0.0
    kettle_docked: bool = True
    kettle_work_s: float = 0.5
    water_kg: float = 1.2
    steam: float = 0.0
    warmth: float = 20.0
    sharpness: float = 0.9
    lamp: str = "high"
    power_w: float = 500.0
    pot_on_hob: bool = True
    fill: float = 40.0
