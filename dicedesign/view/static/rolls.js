// Page of throws: a tap on a face is a throw, written into the file at once.
import { $, chip, followTheme, make, postJson, showVerdict, tallyRows } from './common.js';

const READ_AGAIN_MS = 2000; // Other pages and programs write the same file.
const BUZZ_MS = 12;
const FEW_OUTCOMES = 9; // More have smaller buttons on a phone.

const isStill = matchMedia('(prefers-reduced-motion: reduce)');

let die = null;
let shown = ''; // State on the page, to redraw it only after a change.
let pending = 0; // Throws and undos that are not yet answered.
let judged = 0; // Number of the latest verdict that was asked for.
let queue = Promise.resolve(); // Changes reach the file in the order of the taps.

const faces = () => [...$('faces').children];
const chipOf = (outcome) => chip(die.labels[outcome], die.colors[outcome], die.texts[outcome]);

function showError(error) {
  if (error) showVerdict($('error'), 'bad', '', error.message);
  else $('error').hidden = true;
}

function show(state) {
  const text = JSON.stringify([state.counts, state.last]);
  if (text === shown) return;
  shown = text;
  const total = state.counts.reduce((sum, count) => sum + count, 0);
  $('total').textContent = total.toLocaleString('en');
  $('unit').textContent = total === 1 ? 'throw' : 'throws';
  $('last').replaceChildren(...(state.last === null ? [] : ['last', chipOf(state.last)]));
  $('undo').disabled = total === 0;
  tallyRows($('tally'), { ...die, counts: state.counts });
  judge();
}

async function judge() {
  const number = ++judged;
  try {
    const { style, text } = await postJson('verdict', null);
    // A later verdict is on its way if more was tapped meanwhile.
    if (number === judged) showVerdict($('verdict'), style, '', text);
  } catch (error) {
    showError(error);
  }
}

function change(path, value) {
  pending += 1;
  queue = queue.then(async () => {
    try {
      const state = await postJson(path, value);
      showError(null);
      show(state);
    } catch (error) {
      showError(error);
    } finally {
      pending -= 1;
    }
  });
}

function tap(button, outcome) {
  button.classList.remove('tapped');
  button.getBoundingClientRect(); // Starts the animation again.
  button.classList.add('tapped');
  if (!isStill.matches) navigator.vibrate?.(BUZZ_MS);
  change('roll', outcome);
}

async function readAgain() {
  if (document.hidden || pending) return;
  try {
    const state = await postJson('start', null);
    if (pending) return;
    showError(null);
    show(state);
  } catch (error) {
    showError(error);
  }
}

/** Focus a neighboring button of the grid by the arrow keys. */
function moveFocus(event) {
  const buttons = faces();
  const columns = buttons.filter((button) => button.offsetTop === buttons[0].offsetTop).length;
  const step = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -columns, ArrowDown: columns }[event.key];
  const next = buttons[buttons.indexOf(document.activeElement) + step];
  if (!next) return;
  next.focus();
  event.preventDefault();
}

async function showPictures() {
  const pictures = await postJson('pictures', null);
  faces().forEach((button, outcome) => {
    if (pictures[outcome]) button.prepend(make('img', { src: pictures[outcome], alt: '' }));
  });
}

followTheme($('theme'));
$('undo').onclick = () => change('undo', null);
$('faces').onkeydown = moveFocus;
document.addEventListener('keydown', (event) => {
  if (event.key !== 'z' || !(event.ctrlKey || event.metaKey)) return;
  change('undo', null);
  event.preventDefault();
});
try {
  die = await postJson('start', null);
  $('name').textContent = die.name;
  $('file').textContent = die.file;
  document.title = `${die.name} · dicedesign`;
  $('faces').classList.toggle('many', die.labels.length > FEW_OUTCOMES);
  $('faces').replaceChildren(...die.labels.map((_, outcome) => {
    const button = make('button', { className: 'face' }, chipOf(outcome));
    button.onclick = () => tap(button, outcome);
    return button;
  }));
  show(die);
  setInterval(readAgain, READ_AGAIN_MS);
  document.addEventListener('visibilitychange', readAgain);
  await showPictures();
} catch (error) {
  showError(error);
}
