"""The page around a report: one file, no script, nothing from elsewhere, for a screen or a phone."""

from __future__ import annotations

from html import escape

_STYLE = """
:root { color-scheme: light dark; --ink: #1b2a33; --soft: #5b6b75; --line: #d9e0e4; --page: #fff;
  --card: #f5f8f9; --measured: #9aa8b0; --before: #c4541a; --after: #1769a5; --noise: #7d8b93;
  --new: #dcecf7; --edge: #0004; --log0: #1769a5; --log1: #c4541a; --log2: #00805e; --log3: #a0488c; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6edf1; --soft: #9fb0ba; --line: #2f3e48;
  --page: #12191e; --card: #1a242b; --measured: #71828c; --before: #f08a4b; --after: #6cb8ee;
  --noise: #8b9aa3; --new: #1d3d54; --edge: #fff5;
  --log0: #6cb8ee; --log1: #f08a4b; --log2: #2fc79b; --log3: #dc93cb; } }
* { box-sizing: border-box; }
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--page);
  max-width: 76rem; margin: 0 auto; padding: 1.2rem; }
.top { display: grid; grid-template-columns: minmax(0, 1.25fr) minmax(0, 1fr); gap: 2rem;
  align-items: start; }
.top > div:last-child { background: var(--card); border-radius: .6rem; padding: 0 1.1rem .4rem; }
.kicker { margin: 0; color: var(--soft); font-size: .9rem; }
h1 { margin: .2rem 0 .8rem; font-size: 1.75rem; line-height: 1.25; overflow-wrap: anywhere; }
h2 { margin: 2.4rem 0 .6rem; font-size: 1.2rem; border-bottom: 1px solid var(--line); padding-bottom: .2rem; }
.top h2 { margin: 1rem 0 .6rem; font-size: 1rem; border: 0; }
h3 { margin: 1.4rem 0 .4rem; font-size: 1rem; }
p { margin: .5rem 0; max-width: 46rem; }
ul { margin: .5rem 0; padding-left: 1.2rem; max-width: 46rem; }
li { margin: .3rem 0; overflow-wrap: anywhere; }
.lead { font-size: 1.1rem; }
.small, small { color: var(--soft); font-size: .85rem; }
code, pre { font: .9em ui-monospace, monospace; overflow-wrap: anywhere; }
pre { background: var(--card); padding: .7rem; white-space: pre-wrap; border-radius: .4rem; }
.grid { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(20rem, 100%), 1fr)); gap: .8rem; }
figure { margin: 0; }
svg { display: block; width: 100%; max-width: 30rem; height: auto; font: 11px system-ui, sans-serif; }
svg .name { fill: var(--ink); font-size: 12px; font-weight: 600; }
svg .tick { fill: var(--soft); text-anchor: end; }
svg .below { text-anchor: middle; }
svg .axis { fill: none; stroke: var(--soft); }
svg .grid { stroke: var(--line); stroke-width: .7; }
svg .line { fill: none; stroke-width: 1.3; stroke-linejoin: round; }
svg .fill { stroke: none; opacity: .25; }
svg .line.measured { stroke: var(--measured); stroke-width: 4; }
svg .line.before, svg .start.before { stroke: var(--before); }
svg .line.after, svg .start.after { stroke: var(--after); }
svg .fill.before, svg .mark.before, svg circle.before { fill: var(--before); }
svg .fill.after, svg .mark.after, svg circle.after { fill: var(--after); }
svg .line.whole { stroke: var(--ink); stroke-dasharray: 5 3; } svg .line.zero { stroke: var(--noise); }
svg .cell.before { fill: var(--before); } svg .cell.after { fill: var(--after); }
svg .line.log0 { stroke: var(--log0); } svg circle.log0 { fill: var(--log0); }
svg .line.log1 { stroke: var(--log1); } svg circle.log1 { fill: var(--log1); }
svg .line.log2 { stroke: var(--log2); } svg circle.log2 { fill: var(--log2); }
svg .line.log3 { stroke: var(--log3); } svg circle.log3 { fill: var(--log3); }
svg circle.start { fill: var(--page); }
.legend { font-size: .88rem; color: var(--soft); max-width: none; }
.legend span { margin-right: 1.2rem; display: inline-flex; align-items: baseline; }
.legend span::before { content: ""; flex: none; width: 1.2rem; height: .35rem; margin: 0 .4rem .15rem 0; }
.legend .measured::before { background: var(--measured); }
.legend .before::before { background: var(--before); }
.legend .after::before { background: var(--after); }
.legend .start::before { width: .5rem; height: .5rem; border: 1.5px solid var(--soft); border-radius: 50%;
  margin-bottom: 0; }
.legend .whole::before { background: var(--ink); height: .12rem; margin-bottom: .3rem; }
.legend .log0::before { background: var(--log0); }
.legend .log1::before { background: var(--log1); }
.legend .log2::before { background: var(--log2); }
.legend .log3::before { background: var(--log3); }
.legend .shade { width: 8rem; height: .7rem; margin: 0 .4rem; }
.legend .shade::before { width: 100%; height: 100%; margin: 0; background: none; }
.shade.before { background: linear-gradient(to right, transparent, var(--before)); }
.shade.after { background: linear-gradient(to right, transparent, var(--after)); }
.gap .row { display: grid; grid-template-columns: 4rem minmax(0, 1fr); margin: .45rem 0;
  align-items: center; }
.gap .channel { font-weight: 600; overflow-wrap: anywhere; }
.gap .bars { position: relative; display: block; }
.gap .bar { display: flex; align-items: center; height: 1.05rem; }
.gap i { display: block; flex: none; width: calc((100% - 7rem) * var(--long)); height: .75rem;
  border-radius: 0 .2rem .2rem 0; }
.gap i.before { background: var(--before); } .gap i.after { background: var(--after); }
.gap b { font: 600 .8rem system-ui, sans-serif; margin-left: .4rem; white-space: nowrap; }
.scroll, .eq { overflow-x: auto; background:
  linear-gradient(to right, var(--page) 50%, transparent) left / 2rem 104% no-repeat local,
  linear-gradient(to left, var(--page) 50%, transparent) right / 2rem 104% no-repeat local,
  linear-gradient(to right, var(--edge), transparent) left / .8rem 100% no-repeat scroll,
  linear-gradient(to left, var(--edge), transparent) right / .8rem 100% no-repeat scroll; }
table { border-collapse: collapse; font-size: .92rem; min-width: 50%; }
th { text-align: left; color: var(--soft); font-weight: 600; }
th, td { padding: .25rem 1.1rem .25rem 0; border-bottom: 1px solid var(--line); vertical-align: top;
  font-variant-numeric: tabular-nums; }
th:last-child, td:last-child { padding-right: .2rem; }
tr.new td { background: var(--new); }
.eq { padding: .35rem 0; font-size: 1.1rem; direction: rtl; }
.eq math { direction: ltr; math-style: normal; } .eq mfrac > :last-child { padding-top: .3em; }
/* A browser breaks no line of MathML: terms, factors and sums among them are laid out as rows that wrap. */
.eq math, .eq :is(math, math > mrow, .new) > mrow,
.eq :is(math > mrow, .new) > mrow > mrow:has(> mo:first-child),
.eq :is(math > mrow, .new) > mrow > mrow:has(> mo:first-child) > mrow { display: flex; flex-wrap: wrap;
  align-items: baseline; justify-content: left; row-gap: .3rem; min-width: 0; }
.eq math > mrow { padding-left: 1.8rem; }
.eq math > mrow > :first-child { margin-left: -1.8rem; }
.eq mrow > mrow:has(> mo[stretchy]:first-child) { flex-wrap: nowrap; }
.eq :is(math, math > mrow, .new) > mrow > mo,
.eq :is(math > mrow, .new) > mrow > mrow:has(> mo:first-child) > mrow > mo { padding: 0 .22em; }
.eq mrow > mo[stretchy], .eq mrow > mrow > mrow > mo:first-child { padding: 0; }
math .new { background: var(--new); border-radius: .2rem; padding: .4rem .25rem .2rem; }
summary { cursor: pointer; color: var(--after); padding: .3rem 0; }
.warn { padding-left: 0; }
.warn li { border-left: 3px solid var(--before); padding-left: .5rem; list-style: none; }
@media print {
  body { font-size: 10pt; padding: 0; } h2, h3, .legend { break-after: avoid; }
  figure, tr, .eq, .top > div { break-inside: avoid; } * { print-color-adjust: exact; }
}
@media (max-width: 52rem) {
  .top { grid-template-columns: minmax(0, 1fr); gap: .6rem; }
  body { font-size: 15px; padding: .8rem; } h1 { font-size: 1.4rem; }
  table { font-size: .84rem; min-width: 100%; } th, td { padding-right: .5rem; }
}
"""


def page(title: str, sections: list[str]) -> str:
    """Return a whole HTML page.

    Parameters
    ----------
    title : str
    sections : list of str
        HTML, one after the other.
    """
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(s for s in sections if s)
        + "\n</body>\n</html>\n"
    )
