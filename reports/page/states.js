// Strips of initial states: a click, or Enter on the cell that the arrow keys chose, opens that state's videos.
{
  const CELL = 16;
  let cells = null;  // "task policy world" → [real episode of each cell], in the order in which the strip was drawn
  const cellsOf = strip => {
    if (!cells) {
      cells = new Map();
      for (let i = 0; i < run.count; ++i) {
        if (run.world.of(i) !== run.data.real) continue;
        for (const k of run.together(i)) {
          if (k === i) continue;
          const key = JSON.stringify([run.task.of(i), run.policy.of(i), run.world.of(k)]);
          cells.has(key) ? cells.get(key).push(i) : cells.set(key, [i]);
        }
      }
    }
    return cells.get(JSON.stringify([strip.dataset.task, strip.dataset.policy, strip.dataset.world])) ?? [];
  };

  const describe = (strip, at) => {
    const i = cellsOf(strip)[at];
    if (i === undefined) return "";
    const ends = run.together(i).filter(k => k === i || run.world.of(k) === strip.dataset.world)
        .map(k => `${run.world.of(k)} ${WORDS[run.outcome.of(k)] ?? run.outcome.of(k)}`);
    return `${run.state.of(i)}, seed ${run.seed.of(i)}: ${ends.join(", ")}`;
  };

  for (const strip of all(".states[data-task]")) {
    const tens = all("svg", strip), label = strip.nextElementSibling;
    let at = -1;
    const cursor = element("i", {className: "cursor", hidden: true});
    strip.append(cursor);
    const place = to => {
      const list = cellsOf(strip);
      at = Math.max(0, Math.min(list.length - 1, to));
      const ten = tens[Math.floor(at / 10)];
      if (!ten) return;
      cursor.hidden = false;
      const box = ten.getBoundingClientRect(), home = strip.getBoundingClientRect();
      cursor.style.left = `${box.left - home.left + strip.scrollLeft + at % 10 * CELL}px`;
      cursor.style.top = `${box.top - home.top + strip.scrollTop}px`;
      label.textContent = describe(strip, at);
    };
    const cellAt = event => {
      const ten = event.target.closest("svg");
      if (!ten) return -1;
      const cell = tens.indexOf(ten) * 10 + Math.floor((event.clientX - ten.getBoundingClientRect().left) / CELL);
      return cell < cellsOf(strip).length ? cell : -1;
    };
    const openCell = () => {
      const list = cellsOf(strip);
      viewer.open(list[at], (i, by) => { const to = list.indexOf(i) + by; return list[to] ?? i; });
    };
    strip.tabIndex = 0;
    strip.setAttribute("aria-label", `${strip.getAttribute("aria-label")}. Arrow keys choose a state, Enter opens its videos.`);
    strip.addEventListener("pointermove", event => { const cell = cellAt(event); if (cell >= 0) place(cell); });
    strip.addEventListener("click", event => { const cell = cellAt(event); if (cell >= 0) { place(cell); openCell(); } });
    strip.addEventListener("focus", () => { if (at < 0) place(0); });
    strip.addEventListener("keydown", event => {
      const by = {ArrowRight: 1, ArrowLeft: -1, ArrowDown: 10, ArrowUp: -10}[event.key];
      if (by) { event.preventDefault(); place(at + by); }
      if (event.key === "Enter" && at >= 0) { event.preventDefault(); openCell(); }
    });
  }
}
