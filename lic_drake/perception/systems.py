"""Systems between a camera and what is found in its images: the camera's errors, and detectors."""

from collections.abc import Callable
from typing import cast

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, LeafSystem
from pydrake.systems.sensors import ImageDepth32F, ImageRgba8U

from lic_drake.perception.apertures import BoardModel, find_apertures
from lic_drake.perception.config import CameraConfig
from lic_drake.perception.goal import find_goal
from lic_drake.perception.image import CameraImage
from lic_drake.perception.noise import disturbed_image
from lic_drake.weak_method import weakly

type _Calc = Callable[[object, object], None]
"""What Drake's stubs want a calculation to be."""


class DisturbedCamera(LeafSystem):
    """Takes what an `RgbdSensor` renders, and returns it as a real camera would.

    Input ports: `color_image` (ImageRgba8U), `depth_image` (ImageDepth32F, metres),
    `body_pose_in_world` (RigidTransform, the camera's true pose X_WC), and `look`, the number of
    the look (1), from which the errors are drawn. Output port: `image` (CameraImage).

    Args:
        config: The camera and its errors.
        draw: Returns the source of a look's draws.
    """

    def __init__(
        self,
        config: CameraConfig,
        draw: Callable[[int], np.random.Generator],
    ) -> None:
        super().__init__()
        self._config, self._draw = config, draw
        for name, value in (
            ("color_image", ImageRgba8U()),
            ("depth_image", ImageDepth32F()),
            ("body_pose_in_world", RigidTransform()),
        ):
            self.DeclareAbstractInputPort(name, Value(value))
        self.DeclareVectorInputPort("look", 1)
        self.DeclareAbstractOutputPort(
            "image", _make_nothing, weakly(cast(_Calc, self._calc_image))
        )

    def _calc_image(self, context: Context, output: AbstractValue) -> None:
        look = int(np.asarray(self.GetInputPort("look").Eval(context))[0])
        exact = camera_image(
            cast(ImageRgba8U, self.GetInputPort("color_image").Eval(context)),
            cast(ImageDepth32F, self.GetInputPort("depth_image").Eval(context)),
            cast(RigidTransform, self.GetInputPort("body_pose_in_world").Eval(context)),
            self._config.focal_px,
        )
        output.set_value(disturbed_image(exact, self._config, self._draw(look)))


class Detector(LeafSystem):
    """Finds something in an image. Input port: `image` (CameraImage); output port: `found`.

    Args:
        find: What finds it; what it raises, evaluating the output raises.
    """

    def __init__(self, find: Callable[[CameraImage], object]) -> None:
        super().__init__()
        self._find = find
        self.DeclareAbstractInputPort("image", _make_nothing())
        self.DeclareAbstractOutputPort(
            "found", _make_nothing, weakly(cast(_Calc, self._calc_found))
        )

    def _calc_found(self, context: Context, output: AbstractValue) -> None:
        image = cast(CameraImage, self.GetInputPort("image").Eval(context))
        output.set_value(self._find(image))


def make_aperture_detector(camera: CameraConfig, board: BoardModel) -> Detector:
    """Returns the system that finds a board's apertures; see `find_apertures`."""
    return Detector(lambda image: find_apertures(image, camera, board))


def make_goal_detector(camera: CameraConfig, ball_radius_m: float) -> Detector:
    """Returns the system that finds the ball; see `find_goal`."""
    return Detector(lambda image: find_goal(image, camera, ball_radius_m))


def camera_image(
    rgba: ImageRgba8U, depth_image: ImageDepth32F, X_WC: RigidTransform, focal_px: float
) -> CameraImage:
    """Returns the images of an `RgbdSensor`, and where they are taken from, as plain arrays."""
    # Copies: what Drake returns may be a view of its own memory.
    color: NDArray[np.uint8] = np.array(np.asarray(rgba.data)[..., :3])
    depth = np.array(np.asarray(depth_image.data)[..., 0], dtype=np.float64)
    depth[~np.isfinite(depth) | (depth <= 0.0)] = np.nan
    return CameraImage(
        color=color,
        depth=depth,
        focal_px=focal_px,
        R_WC=np.array(X_WC.rotation().matrix()),
        p_WC=np.array(X_WC.translation()),
    )


class _Nothing:
    """Stands where a value of Python's own is to come."""


def _make_nothing() -> AbstractValue:
    nothing: AbstractValue = AbstractValue.Make(_Nothing())
    return nothing
