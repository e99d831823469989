// Small helpers of all pages: elements, requests, status marks and bars.

export const $ = (id) => document.getElementById(id);

/** Element with properties and children; texts become text nodes, never HTML. */
export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [key, value] of Object.entries(properties)) {
    if (key in element) element[key] = value;
    else element.setAttribute(key, value);
  }
  element.append(...children);
  return element;
}

/** Post a JSON value; resolves to the answer, or throws an Error with the server's sentence. */
export async function post(path, value, { signal, body } = {}) {
  let response;
  try {
    response = await fetch(path, {
      method: 'POST', signal,
      headers: { 'Content-Type': body ? 'application/octet-stream' : 'application/json' },
      body: body ?? JSON.stringify(value),
    });
  } catch (error) {
    if (error.name === 'AbortError') throw error;
    throw new Error('dicedesign does not answer. Is it still running in the terminal?');
  }
  if (response.ok) return response;
  throw new Error((await response.json().catch(() => ({}))).error ?? `The server answered ${response.status}.`);
}

export const postJson = async (...request) => (await post(...request)).json();

const MARKS = {
  ok: ['Good: ', '<circle cx="10" cy="10" r="9" fill="currentColor"/><path d="m5.800 10.400 2.900 2.900 5.600-6.200" fill="none" stroke="var(--card)" stroke-width="2" stroke-linecap="round" stroke-linejoin="round"/>'],
  warn: ['Caution: ', '<path d="M10 1.800 19 18H1Z" fill="currentColor" stroke="currentColor" stroke-width="1.600" stroke-linejoin="round"/><path d="M10 7.400v5M10 14.800v.6" stroke="var(--card)" stroke-width="2" stroke-linecap="round"/>'],
  bad: ['Not yet: ', '<path d="M6.300 1.200h7.400l5.100 5.100v7.400l-5.100 5.100H6.300l-5.100-5.100V6.300Z" fill="currentColor"/><path d="m7 7 6 6m0-6-6 6" stroke="var(--card)" stroke-width="2" stroke-linecap="round"/>'],
  info: ['', '<circle cx="10" cy="10" r="8" fill="none" stroke="currentColor" stroke-width="1.800"/><path d="M10 9v5M10 5.800v.6" stroke="currentColor" stroke-width="2" stroke-linecap="round"/>'],
};

/** Mark of a status: a shape of its own, and a word for those who do not see it. */
export function mark(style) {
  const [word, shapes] = MARKS[style];
  const holder = make('span', { className: style });
  holder.innerHTML = `<svg viewBox="0 0 20 20" width="14" height="14" aria-hidden="true">${shapes}</svg>`;
  holder.append(make('span', { className: 'unseen', textContent: word }));
  return holder;
}

/** Show a verdict in an element: mark, bold title, text, and a button. */
export function showVerdict(element, style, title, text, button = null) {
  const says = make('div', {}, title ? make('b', { textContent: `${title} ` }) : '', text);
  if (button) says.append(button);
  element.className = `verdict ${style}`;
  element.replaceChildren(...mark(style).childNodes, says);
  element.hidden = false;
}

/** Chip with a label in the color of its outcome. */
export const chip = (label, color, text) =>
  make('span', { className: 'chip', textContent: label, title: label, style: `background:${color};color:${text}` });

export const percent = (p) => `${(100 * p).toFixed(p < 0.0995 ? 1 : 0).replace(/\.0$/, '')} %`;

const BAND = 1.96; // Standard deviations around the expected count, for 95 % of series.
const MIN_BAND = 20; // Number of throws from which the band is shown.

/** Rows of counted and expected throws. */
export function tallyRows(body, { labels, colors, texts, expected, counts }) {
  const total = counts.reduce((a, b) => a + b, 0);
  const deviation = expected.map((p) => (total >= MIN_BAND ? BAND * Math.sqrt((p * (1 - p)) / total) : 0));
  const share = counts.map((count) => (total ? count / total : 0));
  const most = Math.min(1, 1.1 * Math.max(...expected.map((p, i) => Math.max(p + deviation[i], total >= MIN_BAND ? share[i] : p))));
  const width = (p) => `${Math.max(0, Math.min(100, (100 * p) / most))}%`;
  body.parentElement.classList.toggle('tight', labels.length > 6);
  if (body.rows.length !== labels.length || body.dataset.of !== labels.join('\n')) {
    body.dataset.of = labels.join('\n');
    body.replaceChildren(...labels.map((label, i) => make('tr', {},
      make('th', { scope: 'row' }, chip(label, colors[i], texts[i])),
      make('td', {}, make('div', { className: 'bar' }, make('i', { style: `background:${colors[i]}` }), make('u'), make('s'))),
      make('td'))));
  }
  labels.forEach((_, i) => {
    const [fill, band, expectedMark] = body.rows[i].cells[1].firstElementChild.children;
    fill.style.width = width(share[i]);
    expectedMark.style.left = width(expected[i]);
    const [low, high] = [Math.max(0, expected[i] - deviation[i]), Math.min(most, expected[i] + deviation[i])];
    band.style.left = width(low);
    band.style.width = `${(100 * (high - low)) / most}%`;
    const awaited = total * expected[i];
    body.rows[i].cells[2].replaceChildren(...(total
      ? [String(counts[i]), ' ', make('small', { textContent: `(${awaited.toFixed(total < 100 ? 1 : 0).replace(/\.0$/, '')})` })]
      : [make('small', { textContent: percent(expected[i]) })]));
  });
}

/** Light or dark colors: as chosen here, else as the system. */
export function followTheme(button, onChange = () => {}) {
  const set = (dark) => {
    document.documentElement.dataset.theme = dark ? 'dark' : 'light';
    button.setAttribute('aria-pressed', dark);
    onChange(dark);
  };
  button.onclick = () => set(document.documentElement.dataset.theme !== 'dark');
  set(matchMedia('(prefers-color-scheme: dark)').matches);
}
