"""One HTML file that plays a clip: the page of `lfa web` with modules, style and clip inside, for anybody to open."""

from __future__ import annotations

import re
from base64 import b64encode
from hashlib import sha256
from pathlib import Path
from typing import Any

import msgspec

PAGE = Path(__file__).parents[2] / "web" / "page"
MODULES = ("dom.js", "model.js", "stage.js", "source.js", "panel.js", "controls.js", "lesson.js", "main.js")
"""The page's modules, each after those that it imports."""


def html_of(clip: dict[str, Any]) -> str:
    """Return the page that plays `clip`: nothing in it is loaded from anywhere, and its policy forbids that."""
    style = (PAGE / "style.css").read_text(encoding="utf-8")
    script = "\n".join(_inlined((PAGE / name).read_text(encoding="utf-8")) for name in MODULES)
    policy = f"default-src 'none'; img-src data:; style-src '{_hash(style)}'; script-src '{_hash(script)}'"
    data = msgspec.json.encode(clip).decode().replace("<", "\\u003c")
    page = (PAGE / "index.html").read_text(encoding="utf-8")
    page = page.replace("<title>", f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n<title>')
    page = page.replace('<link rel="stylesheet" href="style.css">', f"<style>{style}</style>")
    clip_script = f'<script type="application/json" id="clip">{data}</script>\n'
    return page.replace(
        '<script type="module" src="main.js"></script>', f'{clip_script}<script type="module">{script}</script>'
    )


def _inlined(module: str) -> str:
    """Return a module without its imports and exports: in one file all names are known anyway."""
    without = re.sub(r"^import .*;\n", "", module, flags=re.MULTILINE)
    return re.sub(r"^export ", "", without, flags=re.MULTILINE)


def _hash(text: str) -> str:
    return f"sha256-{b64encode(sha256(text.encode()).digest()).decode()}"
