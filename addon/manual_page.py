# SPDX-License-Identifier: GPL-3.0-or-later
"""Converts the manual from Markdown to HTML, for the zip. Supports as much of Markdown as the manual uses."""

import html
import re

_STYLE = """
body { margin: 0 auto; max-width: 58em; padding: 1em 1.5em 6em; font: 16px/1.5 sans-serif; color: #222 }
h1, h2, h3, h4 { line-height: 1.2; margin-top: 1.8em }
h2 { border-bottom: 1px solid #ccc; padding-bottom: .2em }
table { border-collapse: collapse }
td, th { border: 1px solid #ccc; padding: .3em .6em; vertical-align: top; text-align: left }
img { max-width: 100%; vertical-align: top }
code, pre { background: #f0f0f0; padding: .1em .3em }
pre { padding: .8em; overflow: auto }
"""
_BULLET = re.compile(r'(-|\d+\.) +')


def page(markdown):
    """The HTML page, beside whose file the pictures lie as they do beside the manual's."""
    body = '\n'.join(map(_block, _blocks(markdown.splitlines())))
    return (f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>Detail Deform</title>'
            f'<style>{_STYLE}</style></head>\n<body>\n{body}\n</body></html>\n')


def _blocks(lines):
    """Yields blocks, lists of lines: separated by blank lines, headings, and the ends of code."""
    block, in_code = [], False
    for line in [*lines, ""]:
        if line.startswith('```'):
            if in_code:
                yield [*block, line]
                block, in_code = [], False
                continue
            in_code = True
        ends = not line.strip() or line.startswith('#')
        if ends and not in_code:
            if block:
                yield block
            block = []
            if line.startswith('#'):
                yield [line]
            continue
        block.append(line)


def _block(lines):
    first = lines[0]
    if first.startswith('#'):
        marks, title = first.split(' ', 1)
        level = len(marks)
        return f'<h{level} id="{_anchor(title)}">{_inline(title)}</h{level}>'
    if first.startswith('```'):
        return f'<pre>{html.escape(chr(10).join(lines[1:-1]))}</pre>'
    if first.startswith('    '):
        return f'<pre>{html.escape(chr(10).join(line[4:] for line in lines))}</pre>'
    if first.startswith('|'):
        return _table(lines)
    if _BULLET.match(first):
        return _list(lines)
    return f'<p>{_inline(" ".join(lines))}</p>'


def _table(lines):
    rows = [[cell.strip() for cell in line.strip().strip('|').split('|')] for line in lines]
    cells = [''.join(f'<{tag}>{_inline(cell)}</{tag}>' for cell in row)
             for tag, row in [('th', rows[0]), *(('td', row) for row in rows[2:])]]
    return f'<table>{"".join(f"<tr>{row}</tr>" for row in cells)}</table>'


def _list(lines):
    items = []
    for line in lines:
        mark = _BULLET.match(line)
        if mark:
            items.append(line[mark.end():])
        else:
            items[-1] += f' {line.strip()}'
    kind = 'ul' if lines[0].startswith('-') else 'ol'
    return f'<{kind}>{"".join(f"<li>{_inline(item)}</li>" for item in items)}</{kind}>'


def _anchor(title):
    """The anchor of a heading, as code hosting sites make it."""
    return re.sub(r'[^\w -]', '', title.lower()).replace(' ', '-')


def _inline(text):
    codes = []

    def put_aside(found):  # code has no inline markup
        codes.append(f'<code>{html.escape(found[1])}</code>')
        return f'\0{len(codes) - 1}\0'

    text = html.escape(re.sub(r'`([^`]*)`', put_aside, text), quote=False)
    text = re.sub(r'!\[([^]]*)\]\(([^)]*)\)',
                  r'<img src="\2" alt="\1">', text)
    text = re.sub(r'\[([^]]*)\]\(([^)]*)\)', _link, text)
    text = re.sub(r'\*\*(.+?)\*\*', r'<b>\1</b>', text)
    text = re.sub(r'(?<!\w)\*(\S(?:.*?\S)?)\*(?!\w)', r'<i>\1</i>', text)
    return re.sub('\0(\\d+)\0', lambda found: codes[int(found[1])], text)


def _link(found):
    """A link within the page or to the web; else the text alone, as other files don't come with the add-on."""
    text, target = found[1], found[2]
    return f'<a href="{target}">{text}</a>' if target.startswith(('#', 'http')) else text
