"""How the report of a library looks, in light, in dark and on paper: CSS, as text because an
extension ships only modules."""

STYLE = """
:root {
  color-scheme: light dark;
  --paper: #fbfbfa; --ink: #1d1d1f; --soft: #66666b; --line: #dededb; --head: #f1f1ee;
  --hover: #f5f4ef; --accent: #8a5a00; --mark: #ffe9a8; --bad: #b3261e; --bad-paper: #fdeeec;
  --care: #7a5200; --bar: 3.5rem;
}
@media (prefers-color-scheme: dark) {
  :root {
    --paper: #18181b; --ink: #ebebeb; --soft: #a3a3aa; --line: #34343a; --head: #212125;
    --hover: #202024; --accent: #ffd25a; --mark: #4a3c0c; --bad: #ff9c92; --bad-paper: #331c1a;
    --care: #f0c060;
  }
}
* { box-sizing: border-box; }
html { scroll-padding-top: calc(var(--bar) + 3.5rem); }
body {
  margin: 0; background: var(--paper); color: var(--ink);
  font: 0.875rem/1.4 system-ui, "Segoe UI", Roboto, "Noto Sans", sans-serif;
}
[hidden] { display: none !important; }
header { padding: 1.25rem 1.5rem 0.25rem; }
h1 { margin: 0; font-size: 1.375rem; overflow-wrap: anywhere; }
.totals { margin: 0.25rem 0 0; color: var(--soft); }
.totals b { color: var(--ink); font-weight: 600; }
a { color: var(--accent); text-underline-offset: 0.15em; }
button, input { font: inherit; color: inherit; }
:focus-visible { outline: 2px solid var(--accent); outline-offset: 1px; border-radius: 4px; }

.bar {
  position: sticky; top: 0; z-index: 2; height: var(--bar); padding: 0 1.5rem;
  display: flex; align-items: center; gap: 0.5rem; background: var(--paper); white-space: nowrap;
}
.bar input {
  flex: 0 1 24rem; min-width: 6rem; padding: 0.375rem 0.625rem;
  border: 1px solid var(--line); border-radius: 6px; background: var(--head);
}
.bar button {
  padding: 0.375rem 0.75rem; border: 1px solid var(--line); border-radius: 6px;
  background: var(--head); cursor: pointer;
}
.bar button:hover:enabled { border-color: var(--accent); }
.bar button[aria-pressed=true] { background: var(--mark); border-color: var(--accent); }
.bar button:disabled { color: var(--soft); opacity: 0.6; cursor: default; }
.shown { margin-left: auto; color: var(--soft); overflow: hidden; text-overflow: ellipsis; }

table, thead, tbody { display: block; }
tr {
  display: grid; column-gap: 0.875rem; padding: 0.5rem 1.5rem; align-items: start;
  grid-template-columns:
    192px minmax(9rem, 1fr) 4.75rem 3.75rem 4.5rem 5.5rem 4.5rem 5.25rem 5.5rem 4.25rem
    minmax(9rem, 1fr);
}
th, td { display: block; min-width: 0; padding: 0; text-align: left; font-weight: normal; }
thead {
  position: sticky; top: var(--bar); z-index: 1; background: var(--head);
  border-block: 1px solid var(--line);
}
thead tr { padding-block: 0.25rem; align-items: end; }
thead button {
  width: 100%; padding: 0.25rem 0; border: 0; background: none; cursor: pointer;
  text-align: inherit; white-space: normal; font-weight: 600; line-height: 1.2;
}
thead button:hover { color: var(--accent); }
/* The arrows are not read aloud: aria-sort is. */
thead button::after { content: "\\A0\\2195" / ""; color: var(--soft); opacity: 0.5; }
[aria-sort] button::after { color: var(--accent); opacity: 1; }
[aria-sort=ascending] button::after { content: "\\A0\\25B2" / ""; }
[aria-sort=descending] button::after { content: "\\A0\\25BC" / ""; }

/* A row that is not on the screen is neither laid out nor painted, nor its picture decoded. */
tbody { overflow-anchor: none; }
tbody tr {
  border-bottom: 1px solid var(--line);
  content-visibility: auto; contain-intrinsic-size: auto 113px;
}
tbody tr:hover { background: var(--hover); }
tbody tr.failed { background: var(--bad-paper); }
.n { text-align: right; white-space: nowrap; font-variant-numeric: tabular-nums; }
.size { white-space: normal; }
.picture img { display: block; width: 100%; height: auto; aspect-ratio: 2; border-radius: 4px; }
.picture .none {
  display: grid; place-items: center; aspect-ratio: 2; border-radius: 4px;
  border: 1px dashed var(--line); color: var(--soft);
}
.map, .notes { overflow-wrap: anywhere; white-space: pre-wrap; }
.map b { font-weight: 600; }
.map small, .files { display: block; font-size: 0.93em; color: var(--soft); }
.files a { display: inline-block; margin-right: 0.75em; }
.notes p { margin: 0 0 0.25rem; color: var(--care); }
.notes p.sentence { color: var(--bad); }
.failed .status { color: var(--bad); font-weight: 600; }
.dim { color: var(--soft); }
.nothing { padding: 2rem 1.5rem; color: var(--soft); }
.message { margin: 1rem 1.5rem; padding: 0.75rem 1rem; border: 1px solid var(--accent);
  border-radius: 6px; }

/* Narrower: what there is to say goes below the figures. */
@media (max-width: 1300px) {
  tr {
    column-gap: 0.75rem; padding-inline: 1rem;
    grid-template-columns:
      144px minmax(8rem, 1fr) 4.75rem 3.5rem 4rem 5.5rem 4rem 4.75rem 6.5rem 3.25rem;
  }
  .notes { grid-column: 2 / -1; padding-top: 0.25rem; }
  thead .notes button { width: auto; }
  .picture { grid-row: span 2; }
  header, .bar { padding-inline: 1rem; }
  th:not([aria-sort]) button::after { content: none; }
}
@media (max-width: 990px) {
  tr {
    column-gap: 0.625rem;
    grid-template-columns: 112px minmax(8rem, 1fr) 3.25rem 4rem 5rem 3.75rem 4rem 3.75rem 3rem;
  }
  .status { display: none; }
}
@media (max-width: 790px) {
  .report { overflow-x: auto; }
  table { min-width: 790px; }
  thead { position: static; }
  .bar { height: auto; padding-block: 0.5rem; flex-wrap: wrap; position: static; }
}
@media print {
  :root {
    color-scheme: light;
    --paper: #fff; --ink: #000; --soft: #444; --line: #bbb; --head: #fff; --accent: #000;
    --bad: #900; --bad-paper: #fff; --care: #000;
  }
  html { font-size: 12px; }
  .report { overflow: visible; }
  table { min-width: 0; }
  .bar { display: none; }
  thead { position: static; }
  thead button::after { content: none; }
  tbody tr { content-visibility: visible; break-inside: avoid; }
  header, tr { padding-inline: 0; }
}
"""
