"use strict";
// The run as the page carries it (reports/page_columns.h), and small helpers. Everything below reads `run` and nothing else.
const one = (selector, inside = document) => inside.querySelector(selector);
const all = (selector, inside = document) => [...inside.querySelectorAll(selector)];

// An element with its properties and children. Texts become text nodes: nothing from a run is ever read as markup.
const element = (tag, properties = {}, ...children) => {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.startsWith("aria")) made.setAttribute(`aria-${name.slice(4).toLowerCase()}`, value);
    else if (name in made) made[name] = value;
    else made.setAttribute(name, value);
  }
  made.append(...children.filter(child => child !== null && child !== ""));
  return made;
};

const run = (() => {
  const data = JSON.parse(one("#run-data").textContent);
  const digits = new Uint8Array(128);
  [..."ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"].forEach((c, i) => { digits[c.charCodeAt(0)] = i; });

  const column = ({v, w, s}) => {
    const rows = new Uint32Array(data.n);
    for (let i = 0, at = 0; w > 0 && i < rows.length; ++i) {
      let row = 0;
      for (let place = 0; place < w; ++place) row = row << 6 | digits[s.charCodeAt(at++)];
      rows[i] = row;
    }
    return {values: v, rows, of: i => v[rows[i]]};
  };
  const sentences = text => {
    const words = column(text.column);
    let numbers = null;  // split when first asked for
    const of = i => {
      numbers ??= text.numbers === null ? [] : text.numbers.split("\n");
      const own = text.numbers === null ? [] : numbers[i].split(" ");
      let next = 0;
      return words.of(i).replace(/\x01/g, () => own[next++] ?? "…");
    };
    // What a reason is about: its first clause, numbers left out.
    const clauseOf = value => value.split(/[;:(]/)[0].trim().replace(/\x01/g, "…");
    const clauses = words.values.map(clauseOf);
    return {of, clause: i => clauses[words.rows[i]], clauses: [...new Set(clauses)].filter(Boolean).sort(), cut: text.cut};
  };

  const e = data.episodes, columns = {};
  for (const name of ["task", "state", "policy", "seed", "world", "file", "stages", "outcome", "stop", "video", "thumbnail"]) columns[name] = column(e[name]);
  const judges = e.judges.map(judge => ({name: judge.name, label: column(judge.label), reason: sentences(judge.reason)}));
  const count = data.n;

  // Episodes of one initial state, policy and seed stand side by side: `first[i]` is where those of i begin.
  const first = new Uint32Array(count);
  const pairKey = ["task", "state", "file", "seed"].map(name => columns[name].rows);
  for (let i = 1; i < count; ++i) first[i] = pairKey.every(rows => rows[i] === rows[i - 1]) ? first[i - 1] : i;

  const idOf = i => `${columns.world.of(i)}/${columns.task.of(i)}/${columns.file.of(i)}/${columns.state.of(i)}-s${columns.seed.of(i)}`;
  const linkOf = path => path && data.run + path.split("/").map(encodeURIComponent).join("/");
  const fileOf = (column, i, usual) => linkOf(column.of(i) === "=" ? usual() : column.of(i));
  const embedded = new Map(e.embedded.at.map((at, k) => [at, "data:image/jpeg;base64," + e.embedded.jpeg[k]]));
  let indexById = null;
  return {
    ...columns, count, judges, data,
    reason: sentences(e.reason), end: sentences(e.end),
    id: idOf,
    video: i => fileOf(columns.video, i, () => `videos/${idOf(i)}.mp4`),
    thumbnail: i => embedded.get(i) ?? fileOf(columns.thumbnail, i, () => `thumbs/${idOf(i)}.jpg`),
    taskOf: i => data.tasks[columns.task.of(i)] ?? {ratio: "", period_s: 0.1, stages: []},
    // All worlds' episodes of i's initial state, policy and seed: the real one first.
    together: i => {
      const group = [];
      for (let k = first[i]; k < count && first[k] === first[i]; ++k) group.push(k);
      return group.sort((a, b) => (columns.world.of(b) === data.real) - (columns.world.of(a) === data.real) || a - b);
    },
    indexOf: id => {
      indexById ??= new Map(Array.from({length: count}, (_, i) => [idOf(i), i]));
      return indexById.get(id) ?? -1;
    },
  };
})();

const counts = i => { const o = run.outcome.of(i); return o === "success" || o === "failure"; };
const isFlip = i => {
  const group = run.together(i), real = group[0];
  if (group.length < 2 || run.world.of(real) !== run.data.real || !counts(real)) return false;
  return group.some(k => counts(k) && run.outcome.rows[k] !== run.outcome.rows[real] && (i === real || i === k));
};

const SIGNS = {success: "✓", failure: "✗", cannot_tell: "?", invalid: "⊘", error: "!", unjudged: "–"};
const WORDS = {cannot_tell: "cannot tell", unjudged: "not judged"};
const outcomeBadge = name => element("span", {className: `outcome ${name}`},
    element("span", {ariaHidden: "true"}, SIGNS[name] ?? "?"), ` ${WORDS[name] ?? name}`);

// "clip-" + the episode's id, bytes that are no letter, digit or "-" as _xx: reports/html.h, Anchor.
const anchorOf = i => "clip-" + [...new TextEncoder().encode(run.id(i))].map(byte => {
  const c = String.fromCharCode(byte);
  return /[A-Za-z0-9-]/.test(c) ? c : "_" + byte.toString(16).padStart(2, "0");
}).join("");
const idFromAnchor = anchor => {
  const bytes = [];
  for (let at = 0; at < anchor.length; ++at) {
    if (anchor[at] === "_") { bytes.push(parseInt(anchor.slice(at + 1, at + 3), 16)); at += 2; } else bytes.push(anchor.charCodeAt(at));
  }
  return new TextDecoder().decode(new Uint8Array(bytes));
};
