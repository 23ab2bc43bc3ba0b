"""Pictures of pages for the README and docs, of the runs whose output stands beside them: `make outputs`.

Chromium draws them; where there is none, the pictures stay as they are, and that is said. What a page says in its
summary is written into its picture (PNG, iTXt "Description"), so that a test can compare it with the text beside it.
"""

import re
import shutil
import struct
import subprocess
import sys
import zlib
from html import unescape
from pathlib import Path

PICTURES = Path(__file__).parent / "pictures"
BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
SIGNATURE = b"\x89PNG\r\n\x1a\n"


WINDOW = "header,nav,#robot .grid,section:not(#robot):not(#windows),details.window:not(#window-1){display:none}"
"""style that leaves the robot and the first window of a report"""


def draw(page: Path, name: str, width: int, height: int, style: str = "") -> None:
    """docs/pictures/NAME.png: the first `height` px of a page of so many px, first window open, with a style more."""
    if BROWSER is None:
        sys.stderr.write(f"docs/pictures/{name}.png stays as it is: no Chromium here\n")
        return
    picture = PICTURES / f"{name}.png"
    size = ("--hide-scrollbars", f"--window-size={width},{height}")
    still = ("--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=3000")
    text = page.read_text(encoding="utf-8")
    shown = page.with_name(f"{name}-shown.html")
    opened = text.replace('<details id="window-1"', '<details open id="window-1"')
    shown.write_text(opened.replace("</head>", f"<style>{style}</style></head>"), encoding="utf-8")
    address = shown.absolute().as_uri()
    subprocess.run([BROWSER, *still, *size, f"--screenshot={picture}", address], check=True, capture_output=True)
    picture.write_bytes(described(picture.read_bytes(), _summary(text)))


def described(png: bytes, text: str) -> bytes:
    """A PNG with a text in it. Raises ValueError for what is no PNG."""
    if not png.startswith(SIGNATURE):
        raise ValueError("no PNG")
    data = b"iTXtDescription\0\0\0\0\0" + text.encode()
    chunk = struct.pack(">I", len(data) - 4) + data + struct.pack(">I", zlib.crc32(data))
    head = len(SIGNATURE) + 25  # after IHDR, which comes first
    return png[:head] + chunk + png[head:]


def description(picture: Path) -> str:
    """The text in a PNG; empty where there is none."""
    png = picture.read_bytes()
    at = len(SIGNATURE)
    while at < len(png):
        (size,) = struct.unpack(">I", png[at : at + 4])
        if png[at + 4 : at + 8] == b"iTXt":
            return png[at + 8 : at + 8 + size].rpartition(b"\0")[2].decode()
        at += size + 12
    return ""


def _summary(page: str) -> str:
    """What the page says under its heading "Summary"."""
    found = re.search(r"<dl.*?</dl>", page, re.DOTALL)
    words = re.sub(r"<[^>]+>", " ", found[0] if found else "")
    return " ".join(unescape(words).split())
