"""What the page has beside viser's own client: its title, the style of its bars, and three habits.

Viser's client sends what is dragged at most every 50 ms; the page sends it every 16. A click on
anything of HTML that names an action is told to the server. The page asks no other machine for
anything: the server forbids it by a header, whatever the client tries.
"""

from __future__ import annotations

from typing import Final

from dicedesign.report.charts.palette import ACCENT, DARK, FAINT, GRID, PALE

__all__ = ["ACTION", "HEAD", "POLICY", "TITLE"]

TITLE: Final = "dicedesign"

ACTION: Final = "data-action"
"""Attribute of HTML elements: a word without spaces that the server is told when they are
clicked."""

POLICY: Final = (
    "default-src 'self' 'unsafe-inline' 'unsafe-eval' 'wasm-unsafe-eval' data: blob: ws: wss:; "
    "connect-src 'self' data: blob: ws: wss:; frame-ancestors 'none'"
)
"""Content-Security-Policy: nothing comes from elsewhere."""

_SCRIPT: Final = """
{
  const later = window.setTimeout.bind(window);
  window.setTimeout = (act, wait, ...rest) => later(act, wait === 50 ? 16 : wait, ...rest);
  const tell = (event) => {
    const clicked = event.target.closest && event.target.closest('[ATTRIBUTE]');
    if (!clicked || (event.type === 'keydown' && event.key !== 'Enter')) return;
    const base = location.pathname.replace(/\\/?$/, '/');
    fetch(base + 'action/' + encodeURIComponent(clicked.getAttribute('ATTRIBUTE')));
  };
  document.addEventListener('click', tell);
  document.addEventListener('keydown', tell);
}
""".replace("ATTRIBUTE", ACTION)

_STYLE: Final = f"""
.dd {{ color: {DARK}; font-size: 13px; line-height: 1.35; padding: 2px 12px 6px; }}
.dd h3 {{ font-size: 13px; margin: 6px 0 2px; }}
.dd p {{ margin: 2px 0; }}
.dd .note {{ color: {FAINT}; }}
.dd .wrong {{ color: #9b2226; font-weight: 600; }}
.dd table {{ border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }}
.dd th {{ color: {FAINT}; font-weight: 400; text-align: right; padding: 1px 3px; }}
.dd td {{ padding: 1px 3px; text-align: right; white-space: nowrap; }}
.dd td:first-child, .dd th:first-child {{ text-align: left; }}
.dd td.bar {{ width: 45%; }}
.dd .track {{ background: {GRID}; height: 11px; position: relative; border-radius: 2px; }}
.dd .fill {{ height: 100%; border-radius: 2px; }}
.dd .thrown {{ height: 5px; border-radius: 2px; background: {ACCENT}; margin-top: 1px; }}
.dd .wanted {{ position: absolute; top: -2px; height: 15px; width: 2px; background: {DARK}; }}
.dd [{ACTION}] {{ cursor: pointer; }}
.dd tr[{ACTION}]:hover, .dd tr[{ACTION}]:focus {{ background: {PALE}44; outline: none; }}
.dd tr.chosen {{ background: {PALE}66; }}
"""

HEAD: Final = (
    f'<meta name="referrer" content="no-referrer"><title>{TITLE}</title>'
    f"<script>{_SCRIPT}</script><style>{_STYLE}</style>"
)
"""Goes to the front of the page's head."""
