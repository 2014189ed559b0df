"""Images of boxes and a ball by intersecting rays, without a renderer."""

import numpy as np
from scipy.spatial.transform import Rotation

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.perception.image import CameraImage

WOOD, CARDBOARD, OTHER, YELLOW = (110, 69, 36), (178, 140, 97), (60, 130, 60), (240, 205, 15)
LEVEL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""R_WC of a camera that looks along Wx."""


def tilted(tilt_deg: float, pan_deg: float = 0.0, roll_deg: float = 0.0) -> np.ndarray:
    """R_WC of a camera that looks down and to the left, and is turned about its axis."""
    turn = Rotation.from_euler("ZYX", [pan_deg, tilt_deg, roll_deg], degrees=True)
    return np.asarray(turn.as_matrix() @ LEVEL)


def blank(R_WC: np.ndarray, p_WC: np.ndarray, width: int = 320, height: int = 240) -> CameraImage:
    """An image in which nothing is near."""
    return CameraImage(
        color=np.full((height, width, 3), 180, dtype=np.uint8),
        depth=np.full((height, width), np.nan),
        focal_px=525.0 * width / 640.0,
        R_WC=R_WC,
        p_WC=np.asarray(p_WC, dtype=float),
    )


def draw_boxes(
    image: CameraImage, p_WB: np.ndarray, edges: np.ndarray, colors: list[tuple[int, ...]]
) -> None:
    """Draws boxes with edges along W's axes."""
    directions = image.rays() @ image.R_WC.T
    with np.errstate(divide="ignore", invalid="ignore"):
        for centre, edge, color in zip(p_WB, edges, colors, strict=True):
            a = (centre - 0.5 * edge - image.p_WC) / directions
            b = (centre + 0.5 * edge - image.p_WC) / directions
            enters = np.minimum(a, b).max(axis=-1)
            leaves = np.maximum(a, b).min(axis=-1)
            _put(image, np.where((enters <= leaves) & (enters > 0.0), enters, np.inf), color)


def draw_ball(
    image: CameraImage, p_WG: np.ndarray, radius: float, color: tuple[int, ...] = YELLOW
) -> None:
    """Draws a ball."""
    directions = image.rays() @ image.R_WC.T
    centre = p_WG - image.p_WC
    along, square = directions @ centre, np.sum(directions**2, axis=-1)
    inside = along**2 - square * (centre @ centre - radius**2)
    depth = (along - np.sqrt(np.maximum(inside, 0.0))) / square
    _put(image, np.where(inside > 0.0, depth, np.inf), color)


def draw_instance(image: CameraImage, instance: ClutterInstance) -> None:
    """Draws a board with its covers."""
    known = {"wood": WOOD, "cardboard": CARDBOARD}
    colors = [known.get(name, OTHER) for name in instance.material]
    draw_boxes(image, instance.p_WO, instance.size, colors)


def _put(image: CameraImage, depth: np.ndarray, color: tuple[int, ...]) -> None:
    nearer = depth < np.nan_to_num(image.depth, nan=np.inf)
    image.depth[nearer] = depth[nearer]
    image.color[nearer] = color
