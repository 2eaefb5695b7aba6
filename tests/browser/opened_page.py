"""A page in a browser, with what it asked for and what it complained of."""

import base64
import io
from itertools import combinations

import numpy as np
from PIL import Image

# Whatever has a text of its own, can be pressed or holds a picture, with what it stands in. What stands over a picture
# by intent is left out: the readout in the scene, and uPlot's layer for the mouse.
_BOXES = """() => {
  const hasText = (one) => [...one.childNodes].some((node) => node.nodeType === Node.TEXT_NODE && node.data.trim());
  const shown = [...document.querySelectorAll("body *")].filter((one) =>
    one.checkVisibility({ visibilityProperty: true }) &&
    !one.closest("#readout, .u-over") && (one.matches("canvas, button, input, select") || hasText(one)));
  return shown.map((one) => {
    const { left, top, right, bottom } = one.getBoundingClientRect();
    const around = shown.flatMap((other, index) => (other.contains(one) ? [index] : []));
    return { name: `${one.tagName} ${one.id} ${one.textContent.slice(0, 40)}`, left, top, right, bottom, around };
  });
}"""
# Two lines of text may share a row of pixels.
_TOUCHING_PX = 1.0


class OpenedPage:
    """`asked`: every address that the browser went to for it; `complaints`: errors, warnings and dialogs."""

    def __init__(self, page, address):
        self.page, self.asked, self.complaints = page, [], []
        page.on("request", lambda request: self.asked.append(request.url))
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("dialog", self._refuse)
        page.on("console", self._hear)
        page.goto(address)

    def _refuse(self, dialog):
        self.complaints.append(dialog.message)
        dialog.dismiss()

    def _hear(self, message):
        # A graphics card made of software says that it is slow.
        if "GL Driver Message" not in message.text:
            self.complaints.append(message.text)

    def text(self, selector):
        return self.page.locator(selector).inner_text()

    @property
    def time_s(self):
        """As the clock beside the controls has it."""
        return float(self.text("#clock").split()[0])

    def press(self, *keys):
        for key in keys:
            self.page.keyboard.press(key)

    def scene(self):
        """What is drawn in three dimensions, as rows of pixels: red, green, blue, and 0 where nothing is drawn."""
        address = self.page.evaluate("document.getElementById('scene').toDataURL()")
        return np.asarray(Image.open(io.BytesIO(base64.b64decode(address.partition(",")[2]))))

    def charts(self):
        """The part of each chart that its data are drawn in, by title: rows of pixels."""
        boxes = self.page.locator(".chart").all()
        return [(box.locator("h5").inner_text(), pixels(box.locator(".u-over"))) for box in boxes]

    def overlaps(self):
        """Pairs of things that cover each other."""
        boxes = self.page.evaluate(_BOXES)
        pairs = combinations(enumerate(boxes), 2)
        return [
            f"{one['name']} / {other['name']}"
            for (index, one), (later, other) in pairs
            if index not in other["around"]
            and later not in one["around"]
            and _shared(one, other, "left", "right") > _TOUCHING_PX
            and _shared(one, other, "top", "bottom") > _TOUCHING_PX
        ]


def _shared(one, other, low, high):
    return min(one[high], other[high]) - max(one[low], other[low])


def pixels(element):
    """As a screen has it: red, green, blue."""
    return np.asarray(Image.open(io.BytesIO(element.screenshot())).convert("RGB")).astype(int)


def drawn_share(scene):
    return float((scene[..., 3] > 0).mean())


def line_share(chart):
    """How much of it has the colour of a chart's first line, which is blue on light and dark paper."""
    return float((chart[..., 2] - chart[..., 0] > 60).mean())
