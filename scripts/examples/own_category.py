"""Registers a clutter category, two rows of posts with gaps, and reaches into it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import lic_drake as lic
from lic_drake.clutter.instance import ClutterInstance, join, make_objects


@dataclass(kw_only=True)
class Fence:
    """Rows of posts across the way; a post is missing here and there."""

    rows_x_m: tuple[float, ...] = (0.45, 0.6)
    pitch_m: float = 0.1
    missing: float = 0.3

    def sample(self, rng: np.random.Generator) -> ClutterInstance:
        """Draws one environment."""
        y = np.arange(-0.6, 0.61, self.pitch_m)
        rows = []
        for x in self.rows_x_m:
            standing = y[rng.random(len(y)) > self.missing]
            centres = np.column_stack([np.full(len(standing), x), standing])
            rows.append(make_objects("cylinder", [0.015, 0.2], centres))
        return join(*rows)


lic.register_category("fence", Fence)
Path("fence.yaml").write_text("category: fence\nrobot: planar-arm\nclutter: {missing: 0.4}\n")
scenario = lic.load_scenario("fence.yaml")
p_WG = np.array([0.7, 0.0, 0.0])
starts = lic.make_starts(scenario, scenario.sample_instance("training", 0))
for start in list(starts.grid)[::4]:
    record = lic.run_reach(lic.ReachRequest(scenario, "training", 0, p_WG, start))
    print(f"from y {start.x0[1]:+.2f} m: {record.outcome} after {record.duration_s:.1f} s")
