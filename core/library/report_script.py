"""What the report of a library does in a browser, sort and search: JavaScript, as text because an
extension ships only modules. No word of the page comes from it but the count of rows."""

SCRIPT = """
"use strict";
const table = document.querySelector("table");
const body = table.tBodies[0];
const heads = [...table.querySelectorAll("th[data-first]")];
const search = document.getElementById("search");
const shown = document.getElementById("shown");
const nothing = document.getElementById("nothing");
const choices = [...document.querySelectorAll("button[data-choice]")];
const rows = [...body.rows].map((element, place) => ({element, place}));
let choice = "all";

// Rows without a figure come last, whichever way; equal ones in the order of the library.
function sort(head, direction) {
  const column = head.cellIndex;
  const sign = direction === "ascending" ? 1 : -1;
  for (const row of rows) {
    const value = row.element.cells[column].dataset.v;
    row.key = value === undefined ? Infinity : sign * Number(value);
  }
  rows.sort((a, b) => a.key < b.key ? -1 : a.key > b.key ? 1 : a.place - b.place);
  for (const other of heads) other.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", direction);
  body.append(...rows.map(row => row.element));
  toFirst();
}

// What is new is seen from its beginning.
function toFirst() {
  const gap = body.getBoundingClientRect().top - table.tHead.getBoundingClientRect().bottom;
  if (gap < 0) window.scrollBy(0, gap);
}

for (const head of heads) {
  head.querySelector("button").addEventListener("click", () => {
    const first = head.dataset.first;
    const second = first === "ascending" ? "descending" : "ascending";
    sort(head, head.getAttribute("aria-sort") === first ? second : first);
  });
}

// Every word must be in the row, in any order and any case.
function filter() {
  const words = search.value.toLowerCase().split(/\\s+/).filter(Boolean);
  let count = 0;
  for (const row of rows) {
    row.text ??= row.element.textContent.toLowerCase();
    const kinds = row.element.className;
    const wanted = (choice === "all" || kinds.includes(choice))
      && words.every(word => row.text.includes(word));
    row.element.hidden = !wanted;
    count += wanted;
  }
  shown.textContent = count === rows.length ? "" :
    `${count.toLocaleString("en")} of ${rows.length.toLocaleString("en")} shown`;
  nothing.hidden = count > 0 || rows.length === 0;
  toFirst();
}

search.addEventListener("input", filter);
for (const button of choices) {
  button.addEventListener("click", () => {
    choice = button.dataset.choice;
    for (const other of choices) other.setAttribute("aria-pressed", String(other === button));
    filter();
  });
}
document.querySelector(".bar").hidden = false;
// A browser that comes back to the page may keep what was typed.
if (search.value) filter();
"""
