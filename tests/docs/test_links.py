"""In a checkout, links lead somewhere, and pages show their outputs."""

import re
from pathlib import Path
from urllib.parse import unquote

import pytest

ROOT = Path(__file__).parents[2]
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
PAGES = [
    *ROOT.glob("*.md"),
    *(
        page
        for folder in ("docs", "findings", "fmu")
        for page in (ROOT / folder).glob("**/*.md")
        if not {"reference", "gallery"} & {*page.parts}
    ),
]


def anchors(page):
    """Return the anchors that a code host makes of a page's titles."""
    titles = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    plain = [re.sub(r"[`*]|\[([^\]]*)\]\([^)]*\)", r"\1", t) for t in titles]
    return {re.sub(r"[^\w\- ]", "", t.lower()).replace(" ", "-") for t in plain}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_every_link_of_a_page_leads_somewhere_in_a_checkout(page):
    dead = []
    for link in LINK.findall(
        re.sub(r"^(`{3,}).*?^\1", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    ):
        path, _, anchor = link.partition("#")
        if re.match(r"\w+:", link):
            continue
        target = page.parent / unquote(path) if path else page
        if not target.exists() or (anchor and target.suffix == ".md" and anchor not in anchors(target)):
            dead.append(link)
    assert dead == []
