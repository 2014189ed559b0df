"""Stills of a demonstration: rendered off-screen, with the forces on the arm drawn over them."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from pydrake.geometry import (
    Box,
    ClippingRange,
    ColorRenderCamera,
    GeometryInstance,
    PerceptionProperties,
    RenderCameraCore,
    RenderLabel,
    Rgba,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import ContactResults
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.sensors import CameraInfo, ImageRgba8U, RgbdSensor

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.errors import RenderingError
from lic_drake.evaluate.plots import save_figure
from lic_drake.evaluate.trial import Attempt
from lic_drake.perception.config import ExternalConfig
from lic_drake.perception.rendering import make_renderer
