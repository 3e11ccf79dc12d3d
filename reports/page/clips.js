// The clip browser: filters over all episodes, and a grid that holds only what is in sight.
{
  const form = one(".filters"), grid = one(".browser"), output = one("output", form);
  const sizer = element("div", {className: "sizer"});
  const NARROWEST = 150, GAP = 12, CAPTION = 66;
  let shown = [], current = 0;

  const fill = (name, values, words = value => value) =>
      one(`[name=${name}]`, form).append(...values.map(value => element("option", {value}, words(value))));
  for (const name of ["task", "policy", "world"]) fill(name, run[name].values);
  fill("outcome", Object.keys(SIGNS).filter(name => run.outcome.values.includes(name)), name => WORDS[name] ?? name);
  fill("reason", run.reason.clauses, clause => clause.length > 60 ? clause.slice(0, 59) + "…" : clause);

  const apply = () => {
    const value = name => one(`[name=${name}]`, form).value;
    const wanted = ["task", "policy", "world", "outcome"].filter(name => value(name))
        .map(name => [run[name].rows, run[name].values.indexOf(value(name))]);
    const reason = value("reason"), text = value("text").trim().toLowerCase(), flips = one("[name=flips]", form).checked;
    shown = [];
    for (let i = 0; i < run.count; ++i) {
      if (!wanted.every(([rows, code]) => rows[i] === code)) continue;
      if (reason && run.reason.clause(i) !== reason) continue;
      if (flips && !isFlip(i)) continue;
      if (text && !`${run.id(i)} ${run.reason.of(i)}`.toLowerCase().includes(text)) continue;
      shown.push(i);
    }
    const clips = `${run.count} clip${run.count === 1 ? "" : "s"}`;
    output.textContent = shown.length === run.count ? clips : `${shown.length} of ${clips}`;
    current = 0;
    grid.scrollTop = 0;
    draw();
  };

  const layout = () => {
    const width = sizer.clientWidth, columns = Math.max(1, Math.floor((width + GAP) / (NARROWEST + GAP)));
    const cell = (width - GAP * (columns - 1)) / columns;
    let tallest = 0;  // height over width
    for (const task of Object.values(run.data.tasks)) {
      const [w, h] = task.ratio.split(" / ").map(Number);
      if (w && h) tallest = Math.max(tallest, h / w);
    }
    return {columns, cell, height: Math.round(cell * Math.min(tallest || 0.5, 1)) + CAPTION};
  };

  const next = (i, by) => shown[shown.indexOf(i) + by] ?? i;
  const clip = at => {
    const i = shown[at];
    const image = run.thumbnail(i) && run.video(i)
        ? element("img", {loading: "lazy", decoding: "async", alt: "", src: run.thumbnail(i)}) : element("p", {className: "novideo"}, "no video");
    image.style.aspectRatio = run.taskOf(i).ratio;
    const link = element("a", {href: "#" + anchorOf(i), tabIndex: at === current ? 0 : -1, title: run.reason.of(i), ariaLabel: `${run.id(i)}: ${run.outcome.of(i)}`},
        image, element("span", {className: "line"}, outcomeBadge(run.outcome.of(i)), " ", element("b", {}, run.world.of(i))),
        element("span", {className: "line"}, run.policy.of(i)), element("span", {className: "line quiet"}, `${run.task.of(i)} · ${run.state.of(i)} · s${run.seed.of(i)}`));
    const item = element("div", {role: "listitem", className: "clip"}, link);
    item.setAttribute("aria-setsize", shown.length);
    item.setAttribute("aria-posinset", at + 1);
    item.dataset.at = at;
    return item;
  };

  const draw = () => {
    const {columns, cell, height} = layout(), row = height + GAP;
    const rows = Math.ceil(shown.length / columns);
    sizer.style.height = `${Math.max(0, rows * row - GAP)}px`;
    const from = Math.max(0, Math.floor(grid.scrollTop / row) - 1) * columns;
    const to = Math.min(shown.length, (Math.ceil((grid.scrollTop + grid.clientHeight) / row) + 1) * columns);
    const had = new Map([...sizer.children].map(item => [Number(item.dataset.at), item]));
    const key = `${columns} ${cell}`;
    const fresh = draw.key !== key || draw.shown !== shown;
    draw.key = key; draw.shown = shown;
    const items = [];
    for (let at = from; at < to; ++at) {
      const item = !fresh && had.get(at) || clip(at);
      if (!fresh) had.delete(at);
      item.style.cssText = `left:${at % columns * (cell + GAP)}px;top:${Math.floor(at / columns) * row}px;width:${cell}px;height:${height}px`;
      one("a", item).tabIndex = at === current ? 0 : -1;
      if (item.parentNode !== sizer) items.push(item);
    }
    for (const item of had.values()) item.remove();
    sizer.append(...items);
    if (!shown.length && !one(".none", sizer)) sizer.append(element("p", {className: "none"}, "No clip has all of these."));
    draw.columns = columns; draw.row = row;
  };

  const goTo = at => {
    current = Math.max(0, Math.min(shown.length - 1, at));
    const top = Math.floor(current / draw.columns) * draw.row;
    if (top < grid.scrollTop) grid.scrollTop = top;
    if (top + draw.row > grid.scrollTop + grid.clientHeight) grid.scrollTop = top + draw.row - grid.clientHeight;
    draw();
    one(`[data-at="${current}"] a`, sizer)?.focus({preventScroll: true});
  };

  grid.append(sizer);
  grid.hidden = form.hidden = false;
  grid.addEventListener("scroll", () => requestAnimationFrame(draw), {passive: true});
  grid.addEventListener("keydown", event => {
    const page = Math.max(1, Math.floor(grid.clientHeight / draw.row)) * draw.columns;
    const by = {ArrowRight: 1, ArrowLeft: -1, ArrowDown: draw.columns, ArrowUp: -draw.columns, PageDown: page, PageUp: -page, Home: -shown.length, End: shown.length}[event.key];
    if (by) { event.preventDefault(); goTo(current + by); }
  });
  grid.addEventListener("click", event => {
    const item = event.target.closest(".clip");
    if (!item || event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    current = Number(item.dataset.at);
    viewer.open(shown[current], next);
  });
  form.addEventListener("submit", event => event.preventDefault());
  form.addEventListener("input", apply);
  form.addEventListener("reset", () => setTimeout(apply));
  new ResizeObserver(() => draw()).observe(grid);
  apply();

  // Buttons that show the clips behind a number: data-show='{"task": …, "outcome": …}'.
  document.addEventListener("click", event => {
    const asked = event.target.closest("[data-show]");
    if (!asked) return;
    event.preventDefault();
    form.reset();
    for (const [name, value] of Object.entries(JSON.parse(asked.dataset.show))) {
      const field = one(`[name=${name}]`, form);
      if (field.type === "checkbox") field.checked = value; else field.value = value;
    }
    apply();
    one("#clips").scrollIntoView();
  });

  // A link to a clip opens it.
  const reveal = () => {
    if (!location.hash.startsWith("#clip-")) return;
    const i = run.indexOf(idFromAnchor(location.hash.slice(6)));
    if (i >= 0) viewer.open(i, next);
  };
  addEventListener("hashchange", reveal);
  document.addEventListener("click", event => {  // a link to where one is already changes no hash
    const link = event.target.closest("a[href^='#clip-']");
    if (link && !link.closest(".browser") && link.hash === location.hash) reveal();
  });
  reveal();
}
