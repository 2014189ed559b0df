"""Learns where to put a base from a table that another simulator, here plane geometry, wrote."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

import lic_drake as lic

UPPER, FORE, RADIUS = 0.5, 0.45, 0.1  # Two links and a disc in their way, metres.


def distance(p, a, b):
    """Returns distances of points from segments ab, each of shape (n, 2)."""
    t = np.clip(np.sum((p - a) * (b - a), 1) / np.sum((b - a) ** 2, 1), 0, 1)
    return np.linalg.norm(p - a - t[:, None] * (b - a), axis=1)


def reaches(base, target, disc):
    """Returns whether an arm on a base touches its target, and not the disc, with either link."""
    x, y = (target - base).T
    bend = (x**2 + y**2 - UPPER**2 - FORE**2) / (2 * UPPER * FORE)
    q2 = np.arccos(np.clip(bend, -1, 1))
    q1 = np.arctan2(y, x) - np.arctan2(FORE * np.sin(q2), UPPER + FORE * np.cos(q2))
    elbow = base + UPPER * np.column_stack([np.cos(q1), np.sin(q1)])
    clear = np.minimum(distance(disc, base, elbow), distance(disc, elbow, target)) > RADIUS
    return clear & (np.abs(bend) <= 1)


def scenes(rng, n):
    """Draws targets, which the robot sees, and discs somewhere in front, which it does not."""
    target = rng.uniform([-0.4, 0.5], [0.4, 0.8], (n, 2))
    return target, target * rng.uniform(0.3, 0.9, (n, 1)) + rng.normal(0, 0.1, (n, 2))


def random_bases(rng, n):
    """Draws places of the base."""
    return rng.uniform([-0.6, -0.2], [0.6, 0.2], (n, 2))


rng = np.random.default_rng(0)
scene = np.repeat(np.arange(150), 8)  # Eight attempts in each.
target, disc = (a[scene] for a in scenes(rng, 150))
base = random_bases(rng, len(scene))
columns = dict(zip(["base_x", "base_y", "object_x", "object_y"], [*base.T, *target.T], strict=True))
columns |= {"scene": scene, "success": reaches(base, target, disc)}
pq.write_table(pa.table(columns), "rollouts.parquet")

# Or: lic fit rollouts.parquet --decide base_x base_y --given object_x object_y --group scene
#     --at object_x=0.2 object_y=0.6 --map map.png
rollouts = lic.read_rollouts(
    "rollouts.parquet", decide=["base_x", "base_y"], given=["object_x", "object_y"], group="scene"
)
model = lic.fit_rollouts(rollouts, "knn")
target, disc = scenes(rng, 100)
chosen = [model.choose({"object_x": x, "object_y": y}) for x, y in target]
base = np.array([list(decision.values.values()) for decision in chosen])
print(f"random bases reach {reaches(random_bases(rng, 100), target, disc).mean():.0%},", end=" ")
print(f"chosen ones {reaches(base, target, disc).mean():.0%}", end=" ")
print(f"(expected {np.mean([decision.probability for decision in chosen]):.0%})")
