"""Generated parts of the site: a document holds ``<!-- generated: NAME -->``, the site puts Markdown in its place."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from docs.site.commands import commands
from docs.site.fields import fields
from docs.site.forces import forces

PARTS: Mapping[str, Callable[[], str]] = {"commands": commands, "fields": fields, "forces": forces}


def with_generated(document: str) -> str:
    """Return a document's text with each generated part in its place."""
    return re.sub(r"^<!-- generated: (\w+) -->$", lambda match: PARTS[match[1]](), document, flags=re.MULTILINE)
