"""The renderer of the simulated cameras: VTK on EGL, which needs neither display nor GPU."""

from collections.abc import Sequence

from pydrake.geometry import (
    LightParameter,
    MakeRenderEngineVtk,
    RenderEngine,
    RenderEngineVtkParams,
)

from lic_drake.errors import RenderingError

PACKAGES = "libegl1 libgl1 libgl1-mesa-dri"
"""The Debian packages that the renderer needs."""


# A lamp at the ceiling and some light from where the camera is.
_ROOM = (
    LightParameter(type="directional", frame="world", direction=[0.3, -0.2, -1.0], intensity=0.8),
    LightParameter(type="directional", frame="camera", direction=[0, 0, 1], intensity=0.6),
)


def make_renderer(lights: Sequence[LightParameter] = _ROOM) -> RenderEngine:
    """Returns a renderer of cameras' images.

    Args:
        lights: The lamps.

    Raises:
        RenderingError: A system library is missing.
    """
    params = RenderEngineVtkParams(
        backend="EGL",
        default_clear_color=[0.80, 0.84, 0.88],
        lights=list(lights),
    )
    try:
        return MakeRenderEngineVtk(params)
    except RuntimeError as error:
        raise RenderingError(
            f"cameras cannot be simulated: {' '.join(str(error).split())} A graphics library is"
            f" missing or does not work; install it with: apt-get install {PACKAGES}"
        ) from None
