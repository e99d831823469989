"""Looks of a page in a browser: what is on the screen is inside it, legible and not cut."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from playwright.sync_api import Page

MIN_CONTRAST = 4.5
"""Contrast of text. Source: Web Content Accessibility Guidelines 2.2, criterion 1.4.3."""

MIN_TARGET_PIXELS = 24.0
"""Side of what can be pressed. Source: the same, criterion 2.5.8."""

MIN_TEXT_PIXELS = 11.0

_TEXTS = """() => {
  const pen = document.createElement('canvas').getContext('2d', { willReadFrequently: true });
  const rgba = (color) => {
    pen.clearRect(0, 0, 1, 1);
    pen.fillStyle = color;
    pen.fillRect(0, 0, 1, 1);
    return [...pen.getImageData(0, 0, 1, 1).data];
  };
  const isSeen = (one) => one.checkVisibility({ visibilityProperty: true })
    && !one.closest('.unseen, svg, :disabled, canvas');
  const isText = (one) => ['INPUT', 'SELECT'].includes(one.tagName)
    || [...one.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim());
  const groundOf = (one) => {
    for (let at = one; at; at = at.parentElement) {
      const color = rgba(getComputedStyle(at).backgroundColor);
      if (color[3] === 255) return color;
    }
    return [255, 255, 255];
  };
  return [...document.body.querySelectorAll('*')].filter((one) => isSeen(one) && isText(one))
    .map((one) => {
      const style = getComputedStyle(one), box = one.getBoundingClientRect();
      return {
        what: `${one.tagName} ${one.id} ${(one.value || one.innerText || '').slice(0, 60)}`,
        box: [box.left, box.right, box.width * box.height], size: parseFloat(style.fontSize),
        color: rgba(style.color), ground: groundOf(one),
        isCut: one.scrollWidth > one.clientWidth + 1 && one.tagName !== 'INPUT'
          && style.display !== 'inline' && style.overflowX !== 'visible',
      };
    });
}"""

_TARGETS = """() => [...document.querySelectorAll('button, a, select, label:has(input), summary')]
  .filter((one) => one.checkVisibility() && getComputedStyle(one).display !== 'inline')
  .map((one) => [one.id || one.innerText, one.getBoundingClientRect().width,
    one.getBoundingClientRect().height])"""


def luminance(color: list[float]) -> float:
    """Relative luminance of [red, green, blue] from 0 to 255 (WCAG 2.2)."""
    channels = np.array(color[:3]) / 255.0
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(a: list[float], b: list[float]) -> float:
    """Contrast of two colors, from 1 to 21 (WCAG 2.2)."""
    light, dark = sorted([luminance(a), luminance(b)], reverse=True)
    return (light + 0.05) / (dark + 0.05)


def check_looks(page: Page) -> None:
    """Nothing needs sideways scrolling, texts are legible and whole, and targets large enough."""
    size = page.viewport_size
    assert size is not None
    assert page.evaluate("document.documentElement.scrollWidth") <= size["width"]
    for text in page.evaluate(_TEXTS):
        left, right, area = text["box"]
        if area == 0.0:
            continue
        assert left >= -0.5, text
        assert right <= size["width"] + 0.5, text
        assert not text["isCut"], text
        assert text["size"] >= MIN_TEXT_PIXELS, text
        assert contrast(text["color"], text["ground"]) >= MIN_CONTRAST, text
    for name, width, height in page.evaluate(_TARGETS):
        assert min(width, height) >= MIN_TARGET_PIXELS, name
