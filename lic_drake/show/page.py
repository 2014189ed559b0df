"""Self-contained HTML pages with embedded pictures and recordings."""

import base64
import gzip
import hashlib
import html

UNPACK = (
    "async (text) => new Response(new Blob([Uint8Array.from(atob(text), c => c.charCodeAt(0))])"
    ".stream().pipeThrough(new DecompressionStream('gzip'))).text()"
)
"""JavaScript function that returns the page that `pack` was given."""

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; background: #f7f7f8;
  max-width: 76rem; margin: 1.5rem auto; padding: 0 1rem; }
h1, h2, h3 { line-height: 1.2; }
img { width: 100%; }
iframe { border: 1px solid #ddd; width: 100%; height: 34rem; }
figure { margin: 1rem 0; }
figcaption, footer { color: #555; font-size: 0.9rem; }
"""


def make_page(title: str, body: str, style: str = "") -> str:
    """Returns a page of a plain-text title, HTML, and CSS in addition to that of all pages."""
    heading = html.escape(title)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{heading}</title>\n<style>{_STYLE}{style}</style>\n</head>\n<body>\n"
        f"<h1>{heading}</h1>\n{body}\n</body>\n</html>\n"
    )


def picture(data: bytes, kind: str, caption: str = "", alt: str = "") -> str:
    """Returns the content of an image file as HTML, with a caption unless that is empty.

    `kind` is its media type, such as "image/png", `alt` is for readers who do not see it, by
    default the caption; both texts are plain.
    """
    source = f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"
    image = f'<img alt="{html.escape(alt or caption)}" src="{source}">'
    if not caption:
        return image
    return f"<figure>{image}<figcaption>{html.escape(caption)}</figcaption></figure>"


def linked(name: str, caption: str) -> str:
    """Returns a picture in a file beside the page, which a click opens, with a plain caption."""
    name, caption = html.escape(name), html.escape(caption)
    image = f'<a href="{name}"><img alt="{caption}" src="{name}"></a>'
    return f"<figure>{image}<figcaption>{caption}</figcaption></figure>"


def pack(page: str) -> str:
    """Returns a page compressed, as letters and digits that any HTML may contain.

    A recording of 4.4 MB becomes 1.3 MB. The same page always gives the same text.
    """
    return base64.b64encode(gzip.compress(page.encode(), mtime=0)).decode("ascii")


def embed(page: str, title: str = "recording", height_px: int = 480, button: str = "") -> str:
    """Returns a frame that shows a page, as HTML, for other pages and notebooks.

    With a `button` of that label, the page is shown only once that is pressed, or when the address
    ends with `#` and the id of the section that holds the frame.
    """
    packed = pack(page)
    name = "recording-" + hashlib.sha256(packed.encode()).hexdigest()[:12]
    show = (
        f"() => ({UNPACK})('{packed}')"
        f".then(page => Object.assign(document.getElementById('{name}'),"
        " {srcdoc: page, hidden: false}))"
    )
    frame = (
        f'<iframe id="{name}" title="{html.escape(title)}"{" hidden" if button else ""}'
        f' style="width:100%;height:{height_px}px;border:0"></iframe>\n'
    )
    if not button:
        return f"{frame}<script>({show})()</script>"
    return (
        f'<button id="show-{name}">{html.escape(button)}</button>\n{frame}<script>\n'
        f"{{const button = document.getElementById('show-{name}'), show = {show};\n"
        "button.addEventListener('click', show);\n"
        "if (location.hash.slice(1) === button.closest('section')?.id) show();}</script>"
    )
