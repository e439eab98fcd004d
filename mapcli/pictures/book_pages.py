"""A page that leafs through the turns of Algorithm 9.2's loop: one HTML file, pictures and all."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

STYLE = """
:root { color-scheme: light dark; --ink: #1c1e21; --paper: #fff; --line: #c9ccd1; --best: #dff2d8 }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6e7e9; --paper: #17181a; --line: #44474c; --best: #26472b }
}
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper);
  max-width: 70rem; margin: 1rem auto; padding: 0 1rem }
section { display: none }
section.shown { display: block; scroll-margin-top: 4rem }
nav { position: sticky; top: 0; background: var(--paper); padding: .5rem 0;
  border-bottom: 1px solid var(--line) }
button { font: inherit; padding: .2rem .9rem }
table { border-collapse: collapse; margin: .8rem 0 }
th, td { border: 1px solid var(--line); padding: .25rem .7rem; text-align: right }
th:first-child { text-align: left }
td.best { background: var(--best); font-weight: bold }
small { opacity: .75 }
img { max-width: 100%; background: #fff; border: 1px solid var(--line); margin: .5rem 0 }
"""

SCRIPT = """
const pages = [...document.querySelectorAll('section')];
const box = document.getElementById('page');
let at = 0;
function show(k) {
  at = Math.min(Math.max(k, 0), pages.length - 1);
  pages.forEach((page, n) => page.classList.toggle('shown', n === at));
  box.textContent = `${at + 1} of ${pages.length}`;
  history.replaceState(null, '', '#' + pages[at].id);
}
document.getElementById('back').onclick = () => show(at - 1);
document.getElementById('on').onclick = () => show(at + 1);
const keys = { ArrowLeft: () => at - 1, ArrowRight: () => at + 1, Home: () => 0,
  End: () => pages.length - 1 };
addEventListener('keydown', event => {
  if (event.key in keys) { event.preventDefault(); show(keys[event.key]()); }
});
addEventListener('hashchange', open_at);
function open_at() { show(Math.max(pages.findIndex(page => '#' + page.id === location.hash), 0)); }
open_at();
"""


@dataclass(frozen=True)
class BookPage:
    """One turn of the loop.

    Attributes:
        anchor: of the page; title: what it is about; text: in a few sentences.
        table: rows of texts, the first one and the first column are headings; best: the row and
            column, among the others, that is marked.
        pictures: PNGs with what they show.
    """

    anchor: str
    title: str
    text: str
    table: Sequence[Sequence[str]]
    best: tuple[int, int]
    pictures: Sequence[tuple[bytes, str]]


def html_pages(title: str, pages: Sequence[BookPage]) -> bytes:
    """The page: the arrow keys leaf, Home and End go to the ends."""
    body = "".join(_section(page) for page in pages)
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{escape(title)}</title>
<style>{STYLE}</style>
</head>
<body>
<h1>{escape(title)}</h1>
<nav><button id="back">&larr; before</button> <span id="page"></span>
<button id="on">after &rarr;</button> <small>arrow keys, Home, End</small></nav>
{body}<script>{SCRIPT}</script>
</body>
</html>
""".encode("utf-8", "backslashreplace")  # names of files may hold anything


def _section(page: BookPage) -> str:
    images = "".join(
        f'<img alt="{escape(text)}" src="data:image/png;base64,{base64.b64encode(png).decode()}">\n'
        for png, text in page.pictures
    )
    return (
        f'<section id="{escape(page.anchor)}">\n<h2>{escape(page.title)}</h2>\n'
        f"<p>{escape(page.text)}</p>\n{_table(page)}{images}</section>\n"
    )


def _table(page: BookPage) -> str:
    head = "".join(f"<th>{escape(text)}</th>" for text in page.table[0])
    rows = []
    for i, (name, *cells) in enumerate(page.table[1:]):
        marked = (
            f"<td{' class=best' if (i, j) == page.best else ''}>{escape(text)}</td>"
            for j, text in enumerate(cells)
        )
        rows.append(f"<tr><th>{escape(name)}</th>{''.join(marked)}</tr>\n")
    return f"<table>\n<tr>{head}</tr>\n{''.join(rows)}</table>\n"
