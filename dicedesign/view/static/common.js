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

const NO_ANSWER = 'No answer from dicedesign. Is it still running in the terminal?';

/** Sentence on a failed request; browsers call each broken connection a TypeError. */
export const sentence = (error) => (error instanceof TypeError ? NO_ANSWER : error.message);

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
    throw new Error(NO_ANSWER);
  }
  if (response.ok) return response;
  throw new Error((await response.json().catch(() => ({}))).error ?? `The server answered ${response.status}.`);
}

export const postJson = async (...request) => (await post(...request)).json();

/** Save the answer of the server as a file. */
export async function download(path, value, name) {
  const blob = await (await post(path, value)).blob(), address = URL.createObjectURL(blob);
  make('a', { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}

const MARKS = {
  ok: ['Good: ', '<circle cx="10" cy="10" r="9" fill="currentColor"/><path d="m5.8 10.4 2.9 2.9 5.6-6.2" fill="none" stroke="var(--card)" stroke-width="2" stroke-linecap="round" stroke-linejoin="round"/>'],
  warn: ['Caution: ', '<path d="M10 1.8 19 18H1Z" fill="currentColor" stroke="currentColor" stroke-width="1.6" stroke-linejoin="round"/><path d="M10 7.4v5M10 14.8v.6" stroke="var(--card)" stroke-width="2" stroke-linecap="round"/>'],
  bad: ['Not yet: ', '<path d="M6.3 1.2h7.4l5.1 5.1v7.4l-5.1 5.1H6.3l-5.1-5.1V6.3Z" fill="currentColor"/><path d="m7 7 6 6m0-6-6 6" stroke="var(--card)" stroke-width="2" stroke-linecap="round"/>'],
  info: ['', '<circle cx="10" cy="10" r="8" fill="none" stroke="currentColor" stroke-width="1.8"/><path d="M10 9v5M10 5.8v.6" stroke="currentColor" stroke-width="2" stroke-linecap="round"/>'],
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
  element.classList.remove('ok', 'warn', 'bad', 'info');
  element.classList.add(style);
  element.replaceChildren(...mark(style).childNodes, says);
  element.hidden = false;
}

/** Chip with a label in the color of its outcome. */
export const chip = (label, color, text) =>
  make('span', { className: 'chip', textContent: label, title: label, style: `background:${color};color:${text}` });

export const percent = (p) => `${(100 * p).toFixed(p < 0.0995 ? 1 : 0).replace(/\.0$/, '')} %`;

/** Rows of labeled bars. Lengths are shares of `most`; marks and bands may be missing; `cells` are lists of children. */
export function barRows(body, { labels, colors, texts, values, marks = [], bands = [], cells, most }) {
  const width = (p) => `${Math.max(0, Math.min(100, (100 * p) / most))}%`;
  body.parentElement.classList.toggle('tight', labels.length > 6);
  const key = [...labels, ...colors].join('\n');
  if (body.dataset.key !== key) {
    body.dataset.key = key;
    body.replaceChildren(...labels.map((label, i) => make('tr', {},
      make('th', { scope: 'row' }, chip(label, colors[i], texts[i])),
      make('td', {}, make('div', { className: 'bar' }, make('i', { style: `background:${colors[i]}` }), make('u'), make('s'))),
      make('td'))));
  }
  labels.forEach((_, i) => {
    const row = body.rows[i], [fill, band, at] = row.cells[1].firstElementChild.children;
    fill.style.width = width(values[i]);
    at.hidden = marks[i] == null;
    at.style.left = width(marks[i] ?? 0);
    const [low, high] = bands[i] ?? [0, 0];
    band.style.left = width(low);
    band.style.width = `${Math.max(0, (100 * (Math.min(high, most) - Math.max(low, 0))) / most)}%`;
    row.cells[2].replaceChildren(...cells[i]);
  });
}

const BAND = 1.96; // Standard deviations around the expected count, for 95 % of series.
const MIN_BAND = 20; // Number of throws from which the band is shown.

/** Rows of counted and expected throws. */
export function tallyRows(body, { labels, colors, texts, expected, counts }) {
  const total = counts.reduce((a, b) => a + b, 0), isJudged = total >= MIN_BAND;
  const values = counts.map((count) => (total ? count / total : 0));
  const bands = expected.map((p) => {
    const deviation = isJudged ? BAND * Math.sqrt((p * (1 - p)) / total) : 0;
    return [p - deviation, p + deviation];
  });
  const most = Math.min(1, 1.1 * Math.max(...expected.map((p, i) => Math.max(bands[i][1], isJudged ? values[i] : p))));
  const awaited = (p) => (total * p).toFixed(total < 100 ? 1 : 0).replace(/\.0$/, '');
  const cells = expected.map((p, i) => (total
    ? [String(counts[i]), ' ', make('small', { textContent: `(${awaited(p)})` })]
    : [make('small', { textContent: percent(p) })]));
  barRows(body, { labels, colors, texts, values, marks: expected, bands, cells, most });
}

/** Ends the request before when the next begins; returns a function that gives the signal of the next. */
export function takeLatest() {
  let before = null;
  return () => {
    before?.abort();
    before = new AbortController();
    return before.signal;
  };
}

/** One call of an asynchronous function at a time; of those that wait, the last is made alone. */
export function takeTurns(act) {
  let isRunning = false, isDue = false;
  return async () => {
    isDue = true;
    if (isRunning) return;
    isRunning = true;
    while (isDue) {
      isDue = false;
      await act();
    }
    isRunning = false;
  };
}

/** Tell which row of a table is pointed at; null for none. */
export function watchRows(body, act) {
  body.onmouseover = (event) => { const row = event.target.closest('tr'); if (row) act(row.sectionRowIndex); };
  body.onmouseleave = () => act(null);
}

/** Options of a menu of tables. */
export const tableOptions = (names) => names.map((name) => make('option', { value: name, textContent: name.replace('-', ' ') }));

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
