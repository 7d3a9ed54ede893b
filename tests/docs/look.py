"""Every page of the built site in a browser: ``python -m tests.docs.look out/site [PICTURES]``.

At 390 and 1400 pixels, light and dark: prints pages wider than the window, cut code, errors,
addresses outside the site and broken links. Screenshots are kept if a folder is given.
"""

import asyncio
import sys
from pathlib import Path
from urllib.parse import unquote, urlparse

from tests.browser import browser

LOOKS = ((390, False), (1400, False), (390, True), (1400, True))

#: What is wider than the page, though it could scroll inside.
WIDE = """
(() => {
  const wide = document.documentElement.scrollWidth - innerWidth;
  if (wide <= 0) return '';
  const inside = e => {  // something around it scrolls
    for (let p = e.parentElement; p && p !== document.body; p = p.parentElement)
      if (getComputedStyle(p).overflowX !== 'visible') return true;
    return false;
  };
  const found = [...document.querySelectorAll('article *')]
    .filter(e => e.getBoundingClientRect().right > innerWidth + 1 && !inside(e));
  return `${wide} px wider: ` + found.slice(0, 3).map(e => e.tagName + '.' + e.className).join(', ');
})()
"""
#: Lines of code that are cut at the right edge; output of commands may scroll.
CUT = """
[...document.querySelectorAll('article div.highlight pre')]
  .filter(e => e.scrollWidth > e.clientWidth + 1)
  .filter(e => !e.closest('.cell_output, .highlight-text, .highlight-none'))
  .slice(0, 2).map(e => `${e.scrollWidth - e.clientWidth} px: ` + e.textContent.slice(0, 60)).join('; ')
"""
LINKS = "[...document.querySelectorAll('article a[href], article img[src]')].map(e => e.href || e.src)"


async def look(site, pictures):
    """Return what is wrong, a line each."""
    wrong = []
    pages = sorted(p for p in site.rglob("*.html") if "_static" not in p.parts)
    async with browser() as page:
        for path in pages:
            name = path.relative_to(site)
            for width, dark in LOOKS:
                await page.open(path.resolve().as_uri(), width, 900, dark)
                wide = await page.value(WIDE)
                if wide:
                    wrong.append(f"{name} at {width}: {wide}")
                cut = await page.value(CUT)
                if cut:
                    wrong.append(f"{name} at {width}: code is cut by {cut}")
                if pictures:
                    own = str(name.with_suffix("")).replace("/", "_")
                    await page.picture(pictures / f"{own}-{width}{'-dark' if dark else ''}.png", whole=True)
                if not pictures and width == 1400:
                    break  # dark differs in colours only
            for link in await page.value(LINKS):
                there = urlparse(link)
                if there.scheme == "file" and not Path(unquote(there.path)).exists():
                    wrong.append(f"{name}: {link} leads nowhere")
        outside = {a for a in page.fetched if not a.startswith(("file:", "data:", "blob:"))}
        wrong += [f"fetched from elsewhere: {address}" for address in sorted(outside)]
        said = {
            str(c.get("entry", c).get("text", c)) + str(c.get("entry", {}).get("url", ""))
            for c in page.complaints
        }
        wrong += [f"a page complains: {what}" for what in sorted(said)]
    return wrong, len(pages)


if __name__ == "__main__":
    folder = Path(sys.argv[2]) if len(sys.argv) > 2 else None
    if folder:
        folder.mkdir(parents=True, exist_ok=True)
    problems, count = asyncio.run(look(Path(sys.argv[1]), folder))
    print(*problems, sep="\n")
    print(f"{count} pages, {len(problems)} problems")
    sys.exit(bool(problems))
