"""Recordings inside other pages, notebooks for one: compressed, and playing offline."""

import base64
import gzip
import hashlib
import html
from dataclasses import dataclass
from pathlib import Path

from lic_drake.errors import LicError

UNPACK = (
    "async (text) => new Response(new Blob([Uint8Array.from(atob(text), c => c.charCodeAt(0))])"
    ".stream().pipeThrough(new DecompressionStream('gzip'))).text()"
)
"""JavaScript function that gives the page that `pack` was given."""


def pack(page: str) -> str:
    """Returns a page compressed, as letters and digits that any HTML may contain.

    A recording of 4.4 MB becomes 1.3 MB. The same page always gives the same text.
    """
    return base64.b64encode(gzip.compress(page.encode(), mtime=0)).decode("ascii")


def read_page(path: Path) -> str:
    """Reads a recording.

    Raises:
        LicError: There is none, or it is not a text file.
    """
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise LicError(f"cannot read the recording {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise LicError(f"{path} is not a recording; it is not text") from None


@dataclass(frozen=True)
class EmbeddedRecording:
    """A recording that a notebook shows in its output, without any file or network beside it.

    Attributes:
        path: The recording, as `lic_drake.show.recording.ReachRecording.save` writes it.
        height_px: Height of its frame.
    """

    path: Path
    height_px: int = 480

    def _repr_html_(self) -> str:
        """Returns the frame as HTML; notebooks call this.

        Raises:
            LicError: The recording cannot be read.
        """
        packed = pack(read_page(self.path))
        name = "recording-" + hashlib.sha256(packed.encode()).hexdigest()[:12]
        return (
            f'<iframe id="{name}" title="{html.escape(self.path.stem)}"'
            f' style="width:100%;height:{self.height_px}px;border:0"></iframe>\n'
            f"<script>({UNPACK})('{packed}')"
            f".then(page => document.getElementById('{name}').srcdoc = page)</script>"
        )
