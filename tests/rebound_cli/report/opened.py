"""A page as a program reads it: its elements, its scripts, its data."""

import base64
import json
from html.parser import HTMLParser

import numpy as np

from rebound_cli.report.content import NONE


def unpacked(column):
    """The numbers of a column again, to half the resolution; NaN for none."""
    kind = column["kind"]
    whole = np.frombuffer(base64.b64decode(column["data"]), f"<{kind}").astype(np.float64)
    return np.where(whole == NONE[kind], np.nan, (whole + column["offset"]) * column["resolution"])


class Opened(HTMLParser):
    """`scripts` are those that a browser runs; `tags` all elements in their order, with their attributes."""

    def __init__(self, page):
        super().__init__()
        self.tags, self.scripts, self.styles, self.data = [], [], [], None
        self._open = None
        self.feed(page)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        self._open = (tag, dict(attributes).get("type")) if tag in ("script", "style") else None
        if tag == "script" and self._open[1] is None:
            self.scripts.append("")

    def handle_endtag(self, tag):
        self._open = None

    def handle_data(self, text):
        if self._open == ("script", None):
            self.scripts[-1] += text
        elif self._open == ("script", "application/json"):
            self.data = json.loads(text)
        elif self._open is not None and self._open[0] == "style":
            self.styles.append(text)

    def table(self, name):
        """Its columns as numbers."""
        return {column: unpacked(data) for column, data in self.data["tables"][name]["columns"].items()}

    def attributes(self, name):
        """Every value that any element has for it."""
        return [attributes[name] for _, attributes in self.tags if name in attributes]
