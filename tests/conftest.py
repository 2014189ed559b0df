"""What all tests share: plots without a display, hypothesis settings, a browser, a renderer."""

import gc
import os
import shutil
import signal

import pytest
from hypothesis import settings

os.environ["MPLBACKEND"] = "Agg"
os.environ["LIC_CACHE"] = "off"  # Tests fit, unless they are about kept fits.
# Several test processes share the cores, where threads that wait for each other take most of the
# time: scikit-learn's trees needed 30 s instead of 2.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

# A shell without job control ignores Ctrl-C in what it runs in the background, and child processes
# inherit that; tests that interrupt a child would wait forever.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# A first example may pay for Drake's import or a plant; CI must not fail on a lucky draw.
settings.register_profile(
    "lic", deadline=None, max_examples=50, derandomize=bool(os.environ.get("CI"))
)
settings.load_profile("lic")


# Imports make most of the objects, and all of them stay: the garbage collector is spared them.
gc.disable()


def pytest_collection_finish() -> None:
    """Leaves to the garbage collector what the tests make."""
    gc.collect()
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session")
def chromium() -> str:
    """Path of a Chromium-like browser; tests that ask for it are skipped where there is none."""
    for name in ("chromium", "chromium-browser", "google-chrome"):
        if path := shutil.which(name):
            return path
    pytest.skip("Chromium is missing: apt-get install chromium")


@pytest.fixture(scope="session")
def _renderer() -> None:
    """Tests that ask for it are skipped where the graphics libraries are missing."""
    from lic_drake.errors import RenderingError
    from lic_drake.perception.cameras import make_renderer

    try:
        make_renderer()
    except RenderingError as error:
        pytest.skip(str(error))


@pytest.fixture
def _coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Demonstrations draw few pixels and few estimates."""
    from lic_drake.perception.config import CameraConfig

    monkeypatch.setattr("lic_drake.show.figures.DOTS_PER_INCH", 30)
    monkeypatch.setattr("lic_drake.show.density.DENSITY_SHAPE", (21, 23))
    small = CameraConfig(width=320, height=240, focal_px=275.0)
    monkeypatch.setattr("lic_drake.show.stills.CAMERA", small)
    monkeypatch.setattr("lic_drake.show.film.CAMERA", small)


@pytest.fixture
def registries_restored(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the test registers is forgotten afterwards."""
    from lic_drake.clutter import registry as clutter
    from lic_drake.estimate import registry as estimate
    from lic_drake.robots import registry as robots

    for registry in (clutter._CATEGORIES, robots._ROBOTS, estimate._ESTIMATORS):
        monkeypatch.setattr(registry, "entries", dict(registry.entries))
