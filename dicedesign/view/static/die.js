// The five steps from a wish to a file. All state is in `S`; the server keeps none.
import { $, chip, download, followTheme, make, mark, percent, post, postJson, sentence, showVerdict, takeLatest, tableOptions, takeTurns, tallyRows, watchRows } from './common.js';
import { Experts } from './experts.js';
import { paint, readMesh, Stage, Thumbnails } from './stage.js';

const STEPS = { roll: 'Roll', pick: 'Pick', dress: 'Dress', try: 'Try', take: 'Take' };
const ORDER = Object.keys(STEPS);
const TITLES = { roll: 'What do you want to roll?', pick: 'Pick a die', dress: 'Dress it', try: 'Try it', take: 'Take it' };
const NEXT = { roll: 'Find six dice', pick: 'Dress this die', dress: 'Try it', try: 'Take it', take: 'Design another die' };
const WANTED = 6, TYPING_MS = 700, CHANGE_MS = 120, TALLY_SECONDS = 2.6, IDLE_SPIN = 0.22;
const SCHEMES = [
  ['By outcome', null], ['Ivory with ink labels', ['#ece5d6', '#1f2933']], ['Black with white labels', ['#26292e', '#f7f5ef']],
  ['Green with cream labels', ['#3e6b57', '#f7edd2']], ['Terracotta with cream labels', ['#a34f32', '#fff3e2']], ['Pale blue with navy labels', ['#c3d8ea', '#1c2f57']],
];
const CHOICES = {
  labels: [['given', 'As written'], ['letters', 'A B C'], ['pips', 'Pips'], ['icons', 'Icons'], ['own', 'Own']],
  font: [['', 'Sans'], ['DejaVu Serif', 'Serif'], ['DejaVu Sans Mono', 'Mono']],
  style: [['engraved', 'Cut in'], ['raised', 'Raised']],
  edges: [['sharp', 'Sharp'], ['fillet', 'Round'], ['chamfer', 'Cut']],
  where: [['table', 'Thrown on a table'], ['down', 'Set down gently']],
};
const FRESH_DRESS = { labels: 'given', texts: null, font: '', style: 'engraved', edges: 'sharp', size_mm: null, printer: 'fdm' };
const isCalm = matchMedia('(prefers-reduced-motion: reduce)').matches;
const isNarrow = matchMedia('(max-width: 759px), (max-width: 1000px) and (orientation: portrait)');

const S = { step: 'roll', reached: 0, text: '', target: null, found: null, failure: null, cards: [], die: null, dress: { ...FRESH_DRESS }, scheme: 0, where: 'table', table: null, dressed: null, isDressing: false, problem: null, counts: [], isBusy: false };
const stage = new Stage($('view'), freeArea), thumbnails = new Thumbnails();
const latest = { target: takeLatest(), dice: takeLatest(), print: takeLatest(), judge: takeLatest() };
const start = await postJson('/start', {});
const experts = new Experts(stage, start, { query: () => S.query, hasDie: () => S.dressed !== null });

/** The part of the canvas that no panel covers. */
function freeArea() {
  const { clientWidth: width, clientHeight: height } = stage?.canvas ?? $('view');
  if (isNarrow.matches) return { x: 0, y: 48, width, height: height - 48 - 56 };
  return { x: 0, y: 64, width: $('panel').getBoundingClientRect().left, height: height - 64 - 24 };
}

/* Steps */
function go(step) {
  const isExpert = step === 'experts';
  // A throw ends when nobody watches it.
  if (S.step === 'try') S.finish?.();
  if (isExpert && S.step !== 'experts') S.before = S.step;
  const wasExpert = S.step === 'experts';
  S.step = step;
  document.body.dataset.step = step;
  if (ORDER.indexOf(step) >= ORDER.indexOf('dress')) S.isChosen = true;
  S.reached = Math.max(S.reached, ORDER.indexOf(step));
  for (const pane of document.querySelectorAll('[data-pane]')) pane.hidden = pane.dataset.pane !== step;
  $('map').hidden = $('result').hidden = true;
  $('body').scrollTop = 0;
  $('back').hidden = step === 'roll';
  $('next').hidden = isExpert;
  $('next').disabled = false;
  $('experts').setAttribute('aria-expanded', isExpert);
  stage.ruler.visible = step === 'dress';
  stage.spin = ['roll', 'pick'].includes(step) ? IDLE_SPIN : 0;
  stage.isHeld = false;
  drawSteps();
  if (isExpert) {
    setTitle('For experts', 'Rests of a body, and what moves them');
    experts.enter();
  } else {
    setTitle(step === 'pick' && S.found ? `Dice for ${S.found}` : TITLES[step], `Step ${ORDER.indexOf(step) + 1} of ${ORDER.length}`);
    $('next').textContent = NEXT[step];
    if (wasExpert) {
      experts.exit();
      if (S.target) showDie();
      else begin();
    }
    if (S.dressed && !wasExpert && S.model) stage.stand(S.model.rests[S.model.show].down, 0.45);
    ({ roll: drawTarget, pick: drawCards, dress: drawDress, try: drawTry, take: drawTake })[step]();
  }
  stage.setShare(step === 'try' ? 'table' : 'usual');
  $('title').focus({ preventScroll: true });
}

function setTitle(title, eyebrow) {
  $('title').textContent = title;
  $('eyebrow').textContent = eyebrow;
  $('live').textContent = title;
}

/** Whether the die in view is the one that the fields describe. */
const isReady = () => S.dressed !== null && !S.isDressing && S.problem === null;

function drawSteps() {
  const last = S.die === null ? 'pick' : isReady() ? 'take' : 'dress';
  $('steps').replaceChildren(...ORDER.map((step, i) => {
    const button = make('button', { type: 'button', disabled: i > Math.min(S.reached, ORDER.indexOf(last)), onclick: () => go(step) }, make('b', { textContent: i + 1, 'aria-hidden': 'true' }), STEPS[step]);
    if (step === S.step) button.setAttribute('aria-current', 'step');
    return make('li', {}, button);
  }));
}

$('back').onclick = () => go(S.step === 'experts' ? S.before ?? 'roll' : ORDER[ORDER.indexOf(S.step) - 1]);
$('next').onclick = () => {
  if (S.step === 'roll') ask();
  else if (S.step === 'take') {
    S.reached = 0;
    go('roll');
  } else go(ORDER[ORDER.indexOf(S.step) + 1]);
};
$('experts').onclick = () => go(S.step === 'experts' ? S.before ?? 'roll' : 'experts');

/** Show an error in its element, with a button that corrects it. */
function showError(element, text, label = '', act = null) {
  element.hidden = !text;
  element.replaceChildren(text ?? '');
  if (act) element.append(make('button', { type: 'button', textContent: label, onclick: act }));
}

const isAborted = (error) => error.name === 'AbortError';

/* 1 Roll */
let typing = 0;
$('examples').append(...start.examples.map((text) => make('button', { className: 'pill', type: 'button', textContent: text, onclick: () => setTarget(text) })));
$('target').oninput = () => {
  clearTimeout(typing);
  showError($('target-error'), null);
  $('target').removeAttribute('aria-invalid');
  typing = setTimeout(() => readTarget(), TYPING_MS);
  readTarget(false);
};
$('ask').onsubmit = (event) => {
  event.preventDefault();
  ask();
};

function setTarget(text) {
  $('target').value = text;
  readTarget();
  $('target').focus();
}

/** Ask the server what the field means; resolves to whether it is a target. */
async function readTarget(hasErrors = true) {
  const text = $('target').value.trim();
  let answer;
  try {
    answer = await postJson('/target', { text }, { signal: latest.target() });
  } catch (error) {
    if (isAborted(error)) return false;
    answer = { error: error.message };
  }
  S.text = text;
  S.target = answer.error ? null : answer;
  const isShown = hasErrors && Boolean(answer.error);
  $('target').setAttribute('aria-invalid', isShown);
  showError($('target-error'), isShown ? answer.error : null, `Use ${answer.fix}`, isShown && answer.fix ? () => setTarget(answer.fix) : null);
  drawTarget();
  return Boolean(S.target);
}

function drawTarget() {
  for (const button of $('examples').children) button.setAttribute('aria-pressed', button.textContent === $('target').value.trim());
  if (!S.target) return $('preview').replaceChildren();
  const { labels, probabilities, colors, texts } = S.target, most = Math.max(...probabilities);
  $('preview').replaceChildren(make('h2', { textContent: `${labels.length} outcomes` }), ...labels.map((label, i) => make('div', { className: `share ${labels.length > 6 ? 'tight' : ''}` },
    chip(label, colors[i], texts[i]), make('i', { style: `width:${(100 * probabilities[i]) / most}%;background:${colors[i]}` }), make('span', { textContent: percent(probabilities[i]) }))));
}

async function ask() {
  clearTimeout(typing);
  if (!(await readTarget())) return $('target').focus();
  if (S.found !== S.text) find();
  go('pick');
}

/* 2 Pick */
/** Design dice for the target; one is only to be looked at. */
async function find(count = WANTED) {
  const signal = latest.dice(), { labels, colors, texts } = S.target;
  for (const { model } of S.cards) model.geometry.dispose();
  Object.assign(S, {
    found: count > 1 ? S.text : null, failure: null, isChosen: false, labels, colors, texts, cards: [], order: null, die: null, shown: null,
    dressed: null, isDressing: false, problem: null, model: null, dress: { ...FRESH_DRESS, printer: S.dress.printer }, reached: Math.min(S.reached, 1),
    counts: labels.map(() => 0),
  });
  clearThrows();
  thumbnails.clear();
  // The die of another target.
  $('view').classList.add('is-busy');
  $('caption').textContent = '';
  try {
    const response = await post('/dice', { text: S.text, count }, { signal });
    const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
    for (let rest = '', part = await reader.read(); !part.done; part = await reader.read()) {
      const lines = (rest + part.value).split('\n');
      rest = lines.pop();
      lines.forEach((line) => takeNews(JSON.parse(line)));
    }
    if (!S.order && !S.failure) throw new TypeError('The stream ended early.');
  } catch (error) {
    if (!isAborted(error)) takeNews({ error: sentence(error) });
  }
}

function takeNews(news) {
  if (news.error) Object.assign(S, { failure: shorten(news.error), found: null });
  if (news.die) {
    const model = readMesh(news.die.mesh);
    paint(model, { ...S, blank: start.blank, scheme: null });
    S.cards.push({ ...news.die, model });
    if (S.die === null) pick(news.die.id);
  }
  if (news.order) {
    S.order = news.order;
    S.cards.sort((a, b) => S.order.indexOf(a.id) - S.order.indexOf(b.id));
    // The best may have come late; nobody has chosen yet.
    if (!S.isChosen) pick(S.order[0]);
    $('live').textContent = 'All dice are ready.';
  }
  if (S.step === 'pick') drawCards();
}

function drawCards() {
  const { length } = S.cards, isDone = Boolean(S.order ?? S.failure);
  const hadFocus = $('cards').contains(document.activeElement);
  showError($('pick-error'), S.failure ?? S.problem);
  $('progress').hidden = isDone;
  $('progress-text').textContent = length ? `Making dice: ${length} ready. You can pick one at once.` : 'Making dice: the first takes some seconds.';
  $('progress-bar').value = length;
  $('next').disabled = S.die === null;
  thumbnails.clear();
  const cards = S.cards.map((card, number) => {
    const canvas = make('canvas', { 'aria-hidden': 'true' });
    const input = make('input', { type: 'radio', name: 'candidate', checked: card.id === S.die, onchange: () => { S.isChosen = true; pick(card.id); } });
    const tag = S.order && number === 0 ? [' ', make('span', { className: 'tag', textContent: 'Suggested' })] : [];
    const node = make('label', { className: 'candidate' }, input, canvas, make('b', {}, card.name, ...tag), make('ul', {},
      make('li', { className: card.style }, mark(card.style), card.hands),
      make('li', { textContent: `${card.faces} faces · ${+card.size_mm.toFixed(1)} mm${card.weight_g ? ` · ${card.weight_g.toFixed(0)} g` : ''}` }),
      make('li', { textContent: `${card.is_read_on_top ? 'Read on top' : 'Read underneath'}${card.is_sensitive ? ' · precise printer' : ''}` })));
    return [node, canvas, card];
  });
  const waiting = Array.from({ length: isDone ? 0 : Math.max(0, WANTED - length) }, () => make('div', { className: 'waiting' }));
  $('cards').replaceChildren($('cards').firstElementChild, ...cards.map(([node]) => node), ...waiting);
  cards.forEach(([, canvas, card], number) => thumbnails.add(canvas, card.model, number));
  if (hadFocus) document.querySelector('[name="candidate"]:checked')?.focus();
}

function pick(id) {
  if (id === S.die) return;
  S.die = id;
  S.dress.size_mm = null;
  redress();
}

/* 3 Dress */
CHOICES.printer = start.printers.map((name) => [name, { fdm: 'Filament', sla: 'Resin', sls: 'Powder' }[name] ?? name]);
for (const choice of document.querySelectorAll('.choice[data-key]')) {
  const key = choice.dataset.key;
  choice.append(...(CHOICES[key] ?? experts.choices).map(([value, text]) => make('label', {},
    make('input', { type: 'radio', name: key, value, onchange: () => choose(key, value) }), make('span', { textContent: text }))));
}
$('swatches').append(...SCHEMES.map(([name, colors], i) => make('label', { title: name },
  make('input', { type: 'radio', name: 'scheme', ariaLabel: name, onchange: () => { S.scheme = i; showColors(); } }),
  make('span', { textContent: colors ? '1' : '', style: colors ? `background:${colors[0]};color:${colors[1]}` : 'background:conic-gradient(#3B86DB 0 33%, #F3AE3D 0 66%, #B8497F 0)' }))));
let changing = 0;
$('size').oninput = () => {
  S.dress.size_mm = Number($('size').value);
  later();
  $('size-text').textContent = `${S.dress.size_mm} mm`;
};
$('texts').oninput = () => {
  S.dress.texts = $('texts').value.split(',').map((text) => text.trim());
  later();
};

/** Dress the die when the fields are still. */
function later() {
  clearTimeout(changing);
  expectDress();
  changing = setTimeout(dress, CHANGE_MS);
}

function choose(key, value) {
  if (key === 'drag') return experts.choose(value);
  if (key === 'where') {
    S.where = value;
    clearThrows();
    return drawTry();
  }
  S.dress[key] = value;
  if (key === 'labels' && value === 'own' && !S.dress.texts) S.dress.texts = [...(S.dressed?.labels ?? S.labels)];
  redress();
}

/** Body of requests about the die as it is dressed. */
function query(more = {}) {
  const { labels, texts, font, style, edges, size_mm: size, printer } = S.dress;
  const dress = { labels, font, style, edges, printer, size_mm: size, texts: labels === 'own' ? texts : null };
  for (const [key, value] of Object.entries(FRESH_DRESS)) if (dress[key] === value) delete dress[key];
  return { die: S.die, dress, ...more };
}

function redress() {
  expectDress();
  dress();
}

/** The fields are ahead of the die: what is known of it no longer holds. */
function expectDress() {
  Object.assign(S, { isDressing: true, problem: null, printing: null });
  latest.print();
  clearThrows();
  drawDressing();
}

/** Get the die as dressed, show it, and then whether it prints. */
const dress = takeTurns(async () => {
  const asked = query(), key = JSON.stringify(asked), isCurrent = () => JSON.stringify(query()) === key;
  try {
    const dressed = await postJson('/dress', asked);
    if (!isCurrent()) return;
    Object.assign(S, { dressed, query: asked, model: readMesh(dressed.mesh, S.dress.edges === 'fillet') });
    showDie(S.shown === S.die);
    S.shown = S.die;
  } catch (error) {
    if (!isCurrent()) return;
    // What could be dressed before stays in view.
    S.problem = shorten(error.message);
  }
  S.isDressing = false;
  drawDressing();
});

/** Draw what depends on whether the die in view is the one that the fields describe. */
function drawDressing() {
  $('body').classList.toggle('is-busy', S.step === 'dress' && S.isDressing);
  drawSteps();
  if (S.step === 'pick') drawCards();
  if (S.step === 'dress') drawDress();
}

/** Messages name keys of recipes first; the page has fields instead. */
const shorten = (text) => text.replace(/^(engrave|edges|labels|size_mm|recipe|target)[\w.]*: /, '').replace(/^./, (c) => c.toUpperCase()).replace(/[^.?!]$/, '$&.');

function showDie(isSame = false) {
  if (!S.model || S.step === 'experts') return;
  $('view').classList.remove('is-busy');
  showColors();
  stage.show(S.model, { moved: isSame ? [0, 0, 0] : null });
  stage.drawRuler(S.dressed.size_mm, getComputedStyle(document.body).color);
  stage.ruler.visible = S.step === 'dress';
  const { faces } = S.cards.find((card) => card.id === S.die) ?? {};
  $('caption').textContent = `${faces} faces · ${+S.dressed.size_mm.toFixed(1)} mm`;
}

function showColors(only = null) {
  if (!S.model) return;
  paint(S.model, { ...S, blank: start.blank, scheme: SCHEMES[S.scheme][1], only });
  stage.redraw();
}

function drawDress() {
  for (const input of document.querySelectorAll('[data-pane="dress"] .choice input')) input.checked = S.dress[input.name] === input.value;
  $('swatches').querySelectorAll('input').forEach((input, i) => { input.checked = i === S.scheme; });
  $('texts').hidden = S.dress.labels !== 'own';
  if (S.dress.labels === 'own' && document.activeElement !== $('texts')) $('texts').value = S.dress.texts.join(', ');
  $('next').disabled = !isReady();
  if (S.isDressing) return showVerdict($('print-verdict'), 'info', '', 'Checking whether it prints …');
  if (S.problem) {
    const act = S.dress.size_mm === null ? null : make('button', { type: 'button', textContent: 'Choose the size for me', onclick: () => { S.dress.size_mm = null; redress(); } });
    return showVerdict($('print-verdict'), 'bad', '', S.problem, act);
  }
  const size = S.dressed.size_mm;
  $('size').max = Math.max(60, Math.ceil(size));
  $('size').value = size;
  $('size-text').textContent = `${+size.toFixed(1)} mm`;
  drawPrinting();
}

async function drawPrinting() {
  showVerdict($('print-verdict'), 'info', '', 'Checking whether it prints …');
  try {
    const says = await postJson('/printing', S.query, { signal: latest.print() });
    S.printing = says;
    $('size-text').textContent = `${+S.dressed.size_mm.toFixed(1)} mm · ${says.weight_g.toFixed(1)} g`;
    const button = says.size_mm ? make('button', { type: 'button', textContent: `Make it ${says.size_mm} mm`, onclick: () => { S.dress.size_mm = says.size_mm; redress(); } }) : null;
    showVerdict($('print-verdict'), says.style, says.title, says.text, button);
  } catch (error) {
    if (!isAborted(error)) showVerdict($('print-verdict'), 'bad', '', error.message);
  }
}

/* 4 Try */
$('table').append(...tableOptions(start.tables));
$('table').onchange = () => {
  S.table = $('table').value;
  clearThrows();
  drawTry();
};
$('throw-one').onclick = () => throwIt(1);
$('throw-many').onclick = () => throwIt(100);
$('clear').onclick = () => {
  clearThrows();
  drawTry();
  $('throw-one').focus();
};
watchRows($('tally'), showColors);

function clearThrows() {
  S.counts = S.counts.map(() => 0);
  S.series = (S.series ?? 0) + 1;
  S.isBusy = false;
  S.finish = null;
  $('result').hidden = true;
}

const table = () => (S.where === 'down' ? null : S.table);

function drawTry() {
  for (const input of document.querySelectorAll('[name="where"]')) input.checked = input.value === S.where;
  $('table-row').hidden = S.where === 'down';
  S.table ??= S.dressed?.table ?? start.tables[0];
  $('table').value = S.table;
  $('throw-one').textContent = S.where === 'down' ? 'Set it down' : 'Throw it';
  $('throw-many').textContent = S.where === 'down' ? 'Set down 100 times' : 'Throw 100';
  $('throw-one').disabled = $('throw-many').disabled = S.isBusy || !S.dressed;
  drawTally();
  judge();
}

function drawTally() {
  if (!S.dressed) return;
  $('clear').hidden = !S.counts.some(Boolean);
  tallyRows($('tally'), { labels: S.dressed.labels, colors: S.colors, texts: S.texts, expected: S.dressed.target, counts: S.counts });
}

async function judge() {
  const series = S.series;
  try {
    const says = await postJson('/judge', { ...S.query, counts: S.counts, table: table() }, { signal: latest.judge() });
    if (series === S.series) showVerdict($('tally-verdict'), says.style, '', says.text);
  } catch (error) {
    if (!isAborted(error)) showVerdict($('tally-verdict'), 'bad', '', error.message);
  }
}

async function throwIt(count) {
  if (S.isBusy) return;
  S.isBusy = true;
  $('throw-one').disabled = $('throw-many').disabled = true;
  $('result').hidden = true;
  const { series } = S, isCurrent = () => series === S.series;
  try {
    const thrown = await postJson('/throw', { ...S.query, count, table: table(), seed: Math.floor(Math.random() * 2 ** 31) });
    if (!isCurrent()) return;
    const before = S.counts, after = before.map((value, i) => value + thrown.counts[i]);
    const finish = () => {
      if (!isCurrent()) return;
      Object.assign(S, { counts: after, isBusy: false, finish: null, series: series + 1 });
      if (S.step !== 'try') return;
      if (count === 1) announce(thrown.outcome);
      drawTry();
    };
    S.finish = finish;
    if (S.step !== 'try') finish();
    else if (count > 1) fillTally(before, thrown, isCurrent, finish);
    else stage.play(thrown.motion, () => (S.dressed.is_read_on_top || thrown.outcome < 0 ? finish() : stage.lift(thrown.down, finish)));
  } catch (error) {
    if (!isCurrent()) return;
    S.isBusy = false;
    drawTry();
    latest.judge();
    showVerdict($('tally-verdict'), 'bad', '', error.message);
  }
}

/** One throw in view, while the tally fills. */
function fillTally(before, thrown, isCurrent, finish) {
  stage.play(thrown.motion);
  latest.judge();
  showVerdict($('tally-verdict'), 'info', '', 'Throwing …');
  const queue = thrown.counts.flatMap((count, outcome) => Array(count).fill(outcome));
  for (let i = queue.length - 1; i > 0; i--) {
    const j = Math.floor(Math.random() * (i + 1));
    [queue[i], queue[j]] = [queue[j], queue[i]];
  }
  const began = performance.now(), filled = [...before];
  let shown = 0;
  const step = () => {
    if (!isCurrent()) return;
    const share = isCalm ? 1 : Math.min(1, (performance.now() - began) / 1000 / TALLY_SECONDS) ** 1.4;
    for (; shown < share * queue.length; shown++) filled[queue[shown]]++;
    S.counts = filled;
    drawTally();
    if (share < 1) requestAnimationFrame(step);
    else finish();
  };
  step();
}

function announce(outcome) {
  const label = S.dressed.labels[outcome];
  $('result').hidden = false;
  if (label === undefined) return $('result').replaceChildren('It shows no outcome. Throw it again.');
  $('result').replaceChildren(chip(label, S.colors[outcome], S.texts[outcome]), S.dressed.is_read_on_top ? 'on top' : 'on the face underneath');
}

/* 5 Take */
const FILES = [
  ['stl', 'Download STL', 'For every slicer. In millimeters.'],
  ['3mf', '3MF with two colors', 'For printers with two filaments: body and labels.'],
  ['yaml', 'Recipe', 'A text file that makes this very die again.'],
  ['html', 'Report', 'How to read and print it, with pictures. One file; takes some seconds.'],
];
$('files').append(...FILES.map(([kind, title, text]) => make('li', {}, make('button', { type: 'button', id: `take-${kind}`, onclick: () => save(kind) }, make('b', { textContent: title }), make('small', { textContent: text })))));

function drawTake() {
  showError($('file-error'), null);
  if (!S.dressed) return;
  const { style, hands, message, reading, size_mm: size } = S.dressed;
  const other = style === 'warn' ? make('button', { type: 'button', textContent: 'Pick another die', onclick: () => go('pick') }) : null;
  showVerdict($('take-verdict'), style, `${hands}.`, message.replace(/^Warning: /, '').replace(/^die\.stl/, 'This file').replace(/^./, (c) => c.toUpperCase()), other);
  const facts = [['Read it', reading], ['Print it', 'Solid: 100 % infill.'], ['Size', `${+size.toFixed(1)} mm from corner to corner${S.printing ? `, ${S.printing.weight_g.toFixed(1)} g` : ''}`]];
  $('facts').replaceChildren(...facts.flatMap(([name, text]) => [make('dt', { textContent: name }), make('dd', { textContent: text })]));
}

async function save(kind) {
  const button = $(`take-${kind}`);
  button.disabled = true;
  button.classList.add('is-busy');
  showError($('file-error'), null);
  try {
    await download('/file', { ...S.query, kind, colors: SCHEMES[S.scheme][1] }, { stl: 'die.stl', '3mf': 'die.3mf', yaml: 'die.yaml', html: 'report.html' }[kind]);
  } catch (error) {
    showError($('file-error'), error.message);
  }
  button.disabled = false;
  button.classList.remove('is-busy');
}

/* Start */
followTheme($('theme'), (isDark) => {
  stage.setDark(isDark);
  if (S.dressed) stage.drawRuler(S.dressed.size_mm, getComputedStyle(document.body).color);
});
/** Show the first example. */
async function begin() {
  $('caption').textContent = '';
  $('target').value = start.examples[0];
  await readTarget();
  if (S.target) find(1);
}

go(start.body ? 'experts' : 'roll');
if (!start.body) await begin();
document.body.dataset.ready = 'true';
