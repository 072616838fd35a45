"""Roles of docstrings (``:class:`` and others), which mkdocstrings leaves as they are."""

import re
from typing import Any

ROLE = re.compile(r":(?:class|func|meth|data|mod|attr):<code>[~.]*([\w.]+)</code>")
"""In the page's HTML; dots before a name say where it is from, which readers need not know."""


def on_page_content(html: str, **_: Any) -> str:
    """Replace roles by the names that they refer to."""
    return ROLE.sub(r"<code>\1</code>", html)
