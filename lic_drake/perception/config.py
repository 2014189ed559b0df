"""Cameras: where they are, their images and their errors, as plain data read from YAML."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from lic_drake.config import check_numbers, read_mapping, read_named, read_section
from lic_drake.errors import ScenarioError
from lic_drake.paths import models_dir


@dataclass(kw_only=True)
class NoiseConfig:
    """Errors of a depth camera's images; see `lic_drake.perception.image`."""

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
        check_numbers(
            self,
            non_negative=("depth_sigma_per_m", "depth_step_per_m", "jump_m", "color_sigma"),
            ranges={"dropout": (0.0, 1.0), "edge_dropout": (0.0, 1.0)},
        )

    @property
    def disparity_sigma_per_m(self) -> float:
        """Standard deviation of the disparity 1/z by noise and steps, 1/m."""
        return float(np.hypot(self.depth_sigma_per_m, self.depth_step_per_m / 12**0.5))


@dataclass(kw_only=True)
class PoseErrorConfig:
    """Errors of a camera's believed pose: standard deviations along each axis."""

    translation_m: float = 0.003
    rotation_deg: float = 0.15

    def __post_init__(self) -> None:
        check_numbers(self, non_negative=("translation_m", "rotation_deg"))


@dataclass(kw_only=True)
class CameraConfig:
    """A pinhole camera with registered colour and depth images."""

    # Columns and rows of the images; focal length, in pixels; the range of depths, metres.
    width: int = 640
    height: int = 480
    focal_px: float = 525.0
    nearest_m: float = 0.5
    furthest_m: float = 5.0
    noise: NoiseConfig = field(default_factory=NoiseConfig)
    pose_error: PoseErrorConfig = field(default_factory=PoseErrorConfig)

    def __post_init__(self) -> None:
        beyond = float(np.nextafter(self.nearest_m, np.inf))
        check_numbers(
            self,
            positive=("focal_px", "nearest_m"),
            ranges={"width": (16, 4096), "height": (16, 4096), "furthest_m": (beyond, 1000.0)},
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
        check_numbers(self, vectors={"base_pose": 3})


@dataclass(kw_only=True)
class ExternalConfig:
    """A camera on a stand, its images upright."""

    # Where it is and what it looks at, in W, metres.
    p_WC: list[float] = field(default_factory=lambda: [2.1, 0.8, 1.45])
    target: list[float] = field(default_factory=lambda: [0.84, -0.29, 0.89])
    camera: CameraConfig = field(default_factory=CameraConfig)

    def __post_init__(self) -> None:
        check_numbers(self, vectors={"p_WC": 3, "target": 3})
        if np.linalg.norm(np.subtract(self.target, self.p_WC)[:2]) < 1e-6:
            raise ScenarioError(
                f"a camera at {self.p_WC} cannot look straight up or down at {self.target}; move it"
            )


@dataclass(kw_only=True)
class CamerasConfig:
    """Both cameras, and the ball that the external one looks for."""

    head: HeadConfig = field(default_factory=HeadConfig)
    external: ExternalConfig = field(default_factory=ExternalConfig)
    # Radius of the yellow ball around the goal, metres.
    ball_radius_m: float = 0.03

    def __post_init__(self) -> None:
        check_numbers(self, ranges={"ball_radius_m": (0.001, 1.0)})


def load_cameras(name: str | Path = "foliage") -> CamerasConfig:
    """Reads the cameras of models/cameras/<name>.yaml, or of a YAML file.

    Raises:
        ScenarioError: There is no such file, or a key or value does not fit.
    """
    text = read_named(name, models_dir() / "cameras", "cameras")
    return read_section(CamerasConfig, read_mapping(text, str(name)), str(name))
