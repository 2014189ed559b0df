"""What the cameras are, where they stand and how wrong they are: plain data, read from YAML."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from lic_drake.config import read_mapping, read_section
from lic_drake.errors import ScenarioError
from lic_drake.paths import models_dir

MAX_PIXELS = 4096
"""An image with more columns or rows is refused."""


@dataclass(kw_only=True)
class NoiseConfig:
    """Errors of a depth camera's images; see `lic_drake.perception.noise`."""

    # Standard deviation of a depth z, and the step in which depths come, are these times z^2, 1/m.
    depth_sigma_per_m: float = 1.425e-3
    depth_step_per_m: float = 2.85e-3
    # Share of pixels without depth, anywhere and where depth jumps by more than jump_m, metres.
    dropout: float = 0.01
    edge_dropout: float = 0.5
    jump_m: float = 0.03
    # Standard deviation of the colours, of 255.
    color_sigma: float = 4.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0.0):
                raise ScenarioError(f"camera noise {name} must be 0 or positive, got {value}")
        for name in ("dropout", "edge_dropout"):
            if getattr(self, name) > 1.0:
                raise ScenarioError(f"camera noise {name} must be at most 1: {getattr(self, name)}")


@dataclass(kw_only=True)
class PoseErrorConfig:
    """How far a camera is from where it is believed to be: standard deviations along each axis."""

    translation_m: float = 0.003
    rotation_deg: float = 0.15

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value >= 0.0):
                raise ScenarioError(f"camera pose {name} must be 0 or positive, got {value}")


@dataclass(kw_only=True)
class CameraConfig:
    """A pinhole camera for colour and depth, registered to each other."""

    # Columns and rows of the images; focal length, in pixels; the range of depths, metres.
    width: int = 640
    height: int = 480
    focal_px: float = 525.0
    nearest_m: float = 0.5
    furthest_m: float = 5.0
    noise: NoiseConfig = field(default_factory=NoiseConfig)
    pose_error: PoseErrorConfig = field(default_factory=PoseErrorConfig)

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            if not 16 <= getattr(self, name) <= MAX_PIXELS:
                raise ScenarioError(
                    f"camera {name} must be from 16 to {MAX_PIXELS}, got {getattr(self, name)}"
                )
        if not (np.isfinite(self.focal_px) and self.focal_px > 0.0):
            raise ScenarioError(f"camera focal_px must be a positive number, got {self.focal_px}")
        if not 0.0 < self.nearest_m < self.furthest_m < np.inf:
            raise ScenarioError(
                "a camera needs 0 < nearest_m < furthest_m, got"
                f" {self.nearest_m} and {self.furthest_m}"
            )


@dataclass(kw_only=True)
class HeadConfig:
    """The camera on the PR2's head, and where the robot stands while it looks."""

    # The base's x, y (metres) and heading (radians) in W; height of the torso; how far the head
    # looks down.
    base_pose: list[float] = field(default_factory=lambda: [-1.0, -0.29, 0.0])
    torso_m: float = 0.15
    tilt_deg: float = 18.0
    camera: CameraConfig = field(default_factory=CameraConfig)

    def __post_init__(self) -> None:
        if len(self.base_pose) != 3 or not np.all(np.isfinite(self.base_pose)):
            raise ScenarioError(f"base_pose must be [x, y, heading], got {self.base_pose}")


@dataclass(kw_only=True)
class ExternalConfig:
    """A camera that stands by itself, its images upright."""

    # Where it is and what it looks at, in W, metres.
    p_WC: list[float] = field(default_factory=lambda: [2.1, 0.8, 1.45])
    target: list[float] = field(default_factory=lambda: [0.84, -0.29, 0.89])
    camera: CameraConfig = field(default_factory=CameraConfig)

    def __post_init__(self) -> None:
        for name in ("p_WC", "target"):
            value = getattr(self, name)
            if len(value) != 3 or not np.all(np.isfinite(value)):
                raise ScenarioError(f"external {name} must be [x, y, z] in metres, got {value}")
        across = np.linalg.norm(np.subtract(self.target, self.p_WC)[:2])
        if across < 1e-6:
            raise ScenarioError(
                f"an external camera cannot look straight up or down, from {self.p_WC} at"
                f" {self.target}; move it"
            )


@dataclass(kw_only=True)
class CamerasConfig:
    """All cameras and the ball that one of them looks for."""

    head: HeadConfig = field(default_factory=HeadConfig)
    external: ExternalConfig = field(default_factory=ExternalConfig)
    # Radius of the yellow ball around the goal, metres.
    ball_radius_m: float = 0.03

    def __post_init__(self) -> None:
        if not 0.0 < self.ball_radius_m < 1.0:
            raise ScenarioError(
                f"ball_radius_m must be between 0 and 1 m, got {self.ball_radius_m}"
            )


def load_cameras(name_or_path: str | Path = "foliage") -> CamerasConfig:
    """Reads the cameras of models/cameras/<name>.yaml, or of a YAML file.

    Raises:
        ScenarioError: No such file, or a key or value that does not fit.
    """
    path = Path(name_or_path)
    if path.suffix not in (".yaml", ".yml"):
        path = models_dir() / "cameras" / f"{name_or_path}.yaml"
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise ScenarioError(f"{path} is not a text file; cameras are YAML in UTF-8") from None
    except (OSError, ValueError):
        known = ", ".join(sorted(p.stem for p in (models_dir() / "cameras").glob("*.yaml")))
        raise ScenarioError(
            f"no cameras {str(name_or_path)!r}; shipped cameras: {known}, or give a .yaml path"
        ) from None
    source = str(name_or_path)
    return read_section(CamerasConfig, read_mapping(text, source), source)
