"""Text from a log is shown as text, whatever it holds."""

from __future__ import annotations

from html.parser import HTMLParser

import hypothesis
import hypothesis.strategies as st
import pytest
from markdown_it import MarkdownIt

from gaia_uwb._shared.text import in_html, in_markdown, printable, shown

HOSTILE = (
    "</script><script>alert(1)</script>", '<img src=x onerror="alert(1)">', "a|b", "*a* _b_ `c`",
    "[x](http://x.y)", "![x](y)", "http://evil.example/a", "www.evil.example", "a@b.example",
    "# head", "- item", "line\u2028break\nnew", "\u202ereversed", "\x1b[31mred", "\\", "&lt;b&gt;",
    "~~x~~", "$x$", "x\\|y",
)  # fmt: skip
MARKDOWN = MarkdownIt("commonmark", {"html": True}).enable(["table", "strikethrough"])


def rendered(markdown: str) -> tuple[str, set[str]]:
    """Return the text that a reader sees, and what else there is."""
    texts, others = [], set()
    for block in MARKDOWN.parse(markdown):
        for token in block.children or []:
            if token.type in ("text", "text_special"):
                texts.append(token.content)
            else:
                others.add(token.type)
        if not block.type.startswith(("paragraph", "inline")):
            others.add(block.type)
    return "".join(texts), others


@pytest.mark.parametrize("text", HOSTILE)
def test_markdown_shows_the_text_itself(text: str) -> None:
    assert rendered(f"Cone {in_markdown(text)}.") == (f"Cone {printable(text)}.", set())


@pytest.mark.parametrize("text", HOSTILE)
def test_a_table_keeps_its_cells(text: str) -> None:
    table = f"| a | b |\n| --- | --- |\n| {in_markdown(text)} | 1 |"
    cells = [t for t in MARKDOWN.parse(table) if t.type == "inline"]
    assert len(cells) == 4
    assert "".join(t.content for t in cells[2].children or []) == printable(text)


@hypothesis.given(st.text(alphabet=st.characters(codec="utf-8"), max_size=20))
def test_any_text(text: str) -> None:
    shown = printable(text)
    assert shown.isprintable()
    assert shown
    assert rendered(f"Cone {in_markdown(text)}.") == (f"Cone {shown}.", set())


@pytest.mark.parametrize(
    ("text", "escaped"),
    [
        ("sim:straight/0", "sim:straight/0"),
        ("http://x.y", "http\\://x.y"),
        ("WWW.x.y", "WWW\\.x.y"),
        (":boom:", "\\:boom:"),
        ("a@b", "a\\@b"),
    ],
)
def test_links_that_some_renderers_make_by_themselves(text: str, escaped: str) -> None:
    assert in_markdown(text) == escaped


@pytest.mark.parametrize("text", HOSTILE)
def test_html_shows_the_text_itself(text: str) -> None:
    class Seen(HTMLParser):
        texts = ""
        tags = 0
        title = None

        def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
            Seen.tags += 1
            Seen.title = dict(attrs).get("title")

        def handle_data(self, data: str) -> None:
            Seen.texts += data

    Seen(convert_charrefs=True).feed(f'<b title="{in_html(text)}">{in_html(text)}</b>')
    assert (Seen.texts, Seen.title, Seen.tags) == (printable(text), printable(text), 1)


def test_nothing_is_named_as_such() -> None:
    assert printable(" \n") == "(no name)"
    assert printable("\ud800") == "\\ud800"


@pytest.mark.parametrize("value", ["x" * 10**6, [[[["y" * 99] * 99] * 99] * 99], {"a\n": {}}, 3])
def test_any_value_is_shown_on_one_short_line(value: object) -> None:
    assert len(shown(value)) < 200
    assert "\n" not in shown(value)
