'use strict';
// Elements without a framework. What comes from outside goes into text nodes, never into markup.
const $ = (selector, root = document) => root.querySelector(selector);

function make(tag, attributes = {}, ...children) {
  const [name, ...classes] = tag.split('.');
  const element = document.createElement(name || 'div');
  if (classes.length) element.className = classes.join(' ');
  for (const [key, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith('on')) element.addEventListener(key.slice(2), value);
    else if (value === true) element.setAttribute(key, '');
    else element.setAttribute(key, value);
  }
  for (const child of children.flat()) if (child !== null && child !== undefined && child !== false) element.append(child);
  return element;
}

function show(...children) {
  const screen = $('#screen');
  screen.replaceChildren(...children.flat().filter(Boolean));
  screen.className = '';
  window.scrollTo(0, 0);
  return screen;
}

function speak(sentence) { $('#spoken').textContent = sentence; }

let toastTimer = 0;
function toast(sentence, action = null, seconds = 5) {
  const box = $('#toast');
  clearTimeout(toastTimer);
  box.replaceChildren(make('span', {}, sentence));
  if (action) box.append(make('button', {type: 'button', onclick: () => { hideToast(); action.act(); }}, action.name));
  box.hidden = false;
  toastTimer = setTimeout(hideToast, seconds * 1000);
}
function hideToast() { $('#toast').hidden = true; }

/** A line across the top that stays until its reason is gone; the most urgent one is seen. */
const banners = new Map();
function banner(name, sentence, button = null) {
  if (sentence) banners.set(name, {sentence, button}); else banners.delete(name);
  const box = $('#banner'), first = banners.get('tab') ?? [...banners.values()][0];  // what waits here goes from there
  box.hidden = !first;
  if (!first) return;
  box.replaceChildren(make('span', {}, first.sentence));
  if (first.button) box.append(make('button', {type: 'button', onclick: first.button.act}, first.button.name));
}

function ask(title, children, buttons) {
  const dialog = $('#dialog');
  return new Promise(resolve => {
    const close = value => { dialog.close(); resolve(value); };
    dialog.replaceChildren(make('h2', {id: 'asked'}, title), ...children,
      make('.row', {}, buttons.map(([name, value, kind]) =>
        make('button' + (kind ? '.' + kind : ''), {type: 'button', onclick: () => close(value)}, name))));
    dialog.setAttribute('aria-labelledby', 'asked');
    dialog.oncancel = event => { event.preventDefault(); close(null); };
    dialog.showModal();
  });
}

const words = {success: 'Success', failure: 'Failure', cannot_tell: 'Can’t tell'};
const flagWords = {object_teleports: 'object teleports', object_disappears: 'object disappears', robot_deforms: 'robot deforms',
  blur_hides: 'blur hides the outcome', ends_early: 'clip ends early', wrong_object: 'wrong object'};
const causeWords = {missed: 'missed it', slipped: 'slipped', wrong_object: 'wrong object', wrong_place: 'wrong place',
  collision: 'collision', nothing_done: 'did nothing', other: 'other'};
const named = name => flagWords[name] || causeWords[name] || name.replaceAll('_', ' ');

function secret() {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return [...bytes].map(byte => byte.toString(16).padStart(2, '0')).join('');
}
const plural = (count, one, many = one + 's') => `${count} ${count === 1 ? one : many}`;
