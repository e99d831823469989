// The tab for experts: rests of any body, its Gauss map, and dragging its center of mass, corners and facets.
import { $, barRows, chip, download, make, postJson, showVerdict, tableOptions, takeLatest, watchRows } from './common.js';
import { paint, readMesh } from './stage.js';

const OFF = 5e-4; // Probability from which a change is worth a sentence.
const points = (p) => `${(100 * p).toPrecision(2).replace(/\.?0+$/, '')} percentage point${p === 0.01 ? '' : 's'}`;

export class Experts {
  /** page: `query` of the die in view, and `hasDie`. */
  constructor(stage, start, page) {
    Object.assign(this, { stage, start, page, body: start.body, first: start.body, drag: 'nothing', latest: takeLatest(), counts: null });
    this.choices = [['nothing', 'Nothing'], ['center', 'Center'], ['corner', 'Corner'], ['facet', 'Facet']];
    $('file').append(...start.bodies.map((name) => make('option', { value: name, textContent: name })));
    $('file').onchange = () => this.open('/body/open', { name: $('file').value });
    $('body-table').append(make('option', { value: '', textContent: 'no table' }), ...tableOptions(start.tables));
    $('body-table').onchange = () => this.draw();
    $('body-release').onclick = () => this.move(null, 1);
    $('body-throw').onclick = () => this.move(this.table(), 1);
    $('body-throws').onclick = () => this.move(this.table(), 100);
    $('body-map').onclick = () => this.showMap();
    $('map-close').onclick = () => { $('map').hidden = true; $('body-map').focus(); };
    $('body-restart').onclick = () => this.accept(this.first);
    $('body-uniform').onclick = () => this.change({ uniform: true });
    $('body-save').onclick = () => this.save();
    $('upload').onchange = () => this.upload();
    for (const axis of 'xyz') $(`center-${axis}`).onchange = () => this.typeCenter();
    const rows = $('body-rows');
    watchRows(rows, (row) => this.color(row));
    rows.onclick = (event) => { const row = event.target.closest('tr'); if (row) this.standOn(row.sectionRowIndex); };
    stage.canvas.addEventListener('pointerdown', (event) => this.grab(event), { capture: true });
    stage.canvas.addEventListener('pointermove', (event) => this.pull(event));
    for (const end of ['pointerup', 'pointercancel']) stage.canvas.addEventListener(end, () => this.release());
  }

  /** Table of throws; the first one where none is chosen. */
  table() { return $('body-table').value || this.start.tables[0]; }

  /** Open the tab: the body of the command line, or the die in view. */
  async enter() {
    this.isOpen = true;
    for (const input of document.querySelectorAll('[name="drag"]')) input.checked = input.value === this.drag;
    if (this.page.hasDie()) await this.open('/body/open', this.page.query());
    else if (this.body) this.accept(this.body, true);
    else {
      $('body-facts').textContent = 'Open a mesh below, or make a die first.';
      $('body-rows').replaceChildren();
    }
  }

  exit() {
    this.isOpen = false;
    this.stage.setGlass(false);
    this.stage.mark('center', null);
    this.stage.mark('handle', null);
  }

  async open(path, query, content) {
    $('body-error').hidden = true;
    try {
      const body = await postJson(path, query, { signal: this.latest(), body: content });
      this.first = body;
      this.accept(body, true);
    } catch (error) {
      this.fail(error);
    }
  }

  fail(error) {
    if (error.name === 'AbortError') return;
    this.drawFile();
    $('body-error').textContent = error.message;
    $('body-error').hidden = false;
  }

  /** Name the file in view; a die or a mesh of one's own is none of the list. */
  drawFile() {
    const { bodies } = this.start, name = this.body?.name;
    $('file').value = bodies.includes(name) ? name : '';
    $('files-row').hidden = !bodies.length || (bodies.length === 1 && name === bodies[0]);
  }

  upload() {
    const [file] = $('upload').files;
    if (file) this.open(`/body/upload?name=${encodeURIComponent(file.name)}`, null, file);
    $('upload').value = '';
  }

  /** Show a state of the body; `isNew` frames it. */
  accept(body, isNew = false) {
    if (!this.isOpen) return;
    // The body stays in place when its center of mass moves.
    const moved = isNew ? null : body.center.map((x, i) => x - this.body.center[i]);
    this.body = body;
    this.counts = null;
    $('body-tally').hidden = $('center-error').hidden = true;
    this.model = readMesh(body.mesh);
    this.color();
    if (isNew) $('map').hidden = $('body-error').hidden = true;
    this.stage.show(this.model, { moved, unit: isNew ? null : this.stage.unit });
    this.drawFile();
    this.drawDrag();
    $('title').textContent = body.name === 'die' ? 'This die' : body.name;
    $('caption').textContent = `${body.rests} stable poses`;
    if (!$('map').hidden) this.showMap();
    this.draw();
  }

  color(only = null) {
    if (!this.model) return;
    paint(this.model, { ...this.body, blank: this.start.blank, only });
    this.stage.redraw();
  }

  async draw() {
    const { body } = this, margin = body.margin_deg === null ? '' : ` The least stable tips over at ${body.margin_deg.toPrecision(2)}°.`;
    $('body-facts').textContent = `${body.kind[0].toUpperCase()}${body.kind.slice(1)}; its hull has ${body.corners.toLocaleString('en')} corners and ${body.facets.toLocaleString('en')} facets. ${body.notes.map((note) => `${note[0].toUpperCase()}${note.slice(1)}.`).join(' ')}${margin}`;
    this.drawVerdict();
    const digits = Math.max(0, 4 - Math.floor(Math.log10(body.size)));
    'xyz'.split('').forEach((axis, i) => { $(`center-${axis}`).value = (Math.round(body.center[i] * 10 ** digits) / 10 ** digits + 0).toString(); });
    const name = $('body-table').value, { state } = body;
    let thrown = null;
    if (name) {
      try {
        ({ thrown } = await postJson('/body/thrown', { state, table: name }));
      } catch (error) {
        this.fail(error);
      }
      if (this.body.state !== state || $('body-table').value !== name) return;
    }
    $('body-kind').textContent = body.error === null ? 'Pose' : 'Outcome';
    $('body-thrown').textContent = thrown ? 'Thrown' : 'Set down';
    const values = body.rows.map((row, i) => (thrown ? thrown[i] : row.probability)), marks = body.rows.map((row) => row.target);
    barRows($('body-rows'), {
      labels: body.rows.map((row) => row.label), colors: body.colors, texts: body.texts, values, marks,
      cells: values.map((p) => [`${(100 * p).toFixed(2)} %`]), most: 1.05 * Math.max(...values, ...marks, 1e-9),
    });
    const [count, sum] = body.others;
    $('body-others').textContent = count ? `and ${count.toLocaleString('en')} others, ${(100 * sum).toFixed(2)} % together` : '';
  }

  drawVerdict() {
    const { error, note } = this.body;
    $('body-verdict').hidden = error === null && !note;
    if ($('body-verdict').hidden) return;
    if (error === null) showVerdict($('body-verdict'), 'info', '', note);
    else if (error < OFF) showVerdict($('body-verdict'), 'ok', '', 'It has your probabilities.');
    else showVerdict($('body-verdict'), 'bad', `Your probabilities are off by ${points(error)}.`, note ?? '', make('button', { type: 'button', textContent: 'Start over', onclick: () => this.accept(this.first) }));
  }

  /** Change the state on the server; the latest change wins. */
  async change(change) {
    try {
      const body = await postJson('/body/change', { state: this.body.state, ...change }, { signal: this.latest() });
      this.accept(body);
    } catch (error) {
      this.fail(error);
    }
  }

  typeCenter() {
    const center = [...'xyz'].map((axis) => Number($(`center-${axis}`).value.trim().replace(',', '.') || NaN));
    const isNumber = center.every(Number.isFinite);
    $('center-error').textContent = 'Write three numbers, in the unit of the mesh.';
    $('center-error').hidden = isNumber;
    if (isNumber) this.change({ center });
  }

  standOn(row) {
    const rest = this.body.mesh.rests.find(({ outcome }) => outcome === row);
    if (rest) this.stage.stand(rest.down);
  }

  choose(drag) {
    this.drag = drag;
    if (this.body) this.drawDrag();
  }

  /** Show what can be dragged, and where it is. */
  drawDrag() {
    const { drag, held, stage, body } = this, isHull = drag === 'corner' || drag === 'facet';
    stage.setGlass(drag === 'center');
    stage.mark('center', drag === 'center' ? [0, 0, 0] : null);
    stage.mark('handle', drag === 'corner' && held ? this.toView(held.at.map((x, i) => x + (held.by?.[i] ?? 0)), held, -1) : null);
    $('drag-error').hidden = !isHull || body.hull !== null;
  }

  /** Point between the frames of the held body (`sign` 1: to it) and of the one in view, about their centers of mass. */
  toView(point, held, sign) { return point.map((x, i) => x + sign * (this.body.center[i] - held.base.center[i])); }

  /** Begin to drag what is under the pointer. */
  grab(event) {
    if (!this.isOpen || !this.body || this.drag === 'nothing') return;
    const hit = this.stage.pick(event);
    if (!hit) return;
    const { hull, center } = this.body;
    if (this.drag === 'center') this.held = { at: [0, 0, 0], base: this.body };
    else if (hull) {
      const local = hull.vertices.map((corner) => corner.map((x, i) => x - center[i])), point = hit.point.toArray();
      const distance = (corner) => Math.hypot(...corner.map((x, i) => x - point[i]));
      if (this.drag === 'corner') {
        const nearest = local.reduce((best, corner, i) => (distance(corner) < distance(local[best]) ? i : best), 0);
        this.held = { at: local[nearest], vertices: [nearest], base: this.body };
      } else {
        const height = (facet) => hull.normals[facet].reduce((sum, x, i) => sum + x * (local[hull.facets[facet][0]][i] - point[i]), 0);
        const nearest = hull.facets.reduce((best, _, i) => (Math.abs(height(i)) < Math.abs(height(best)) ? i : best), 0);
        this.held = { at: point, vertices: hull.facets[nearest], normal: hull.normals[nearest], base: this.body };
      }
    }
    if (!this.held) return;
    this.held.from = this.stage.pointUnder(event, this.held.at);
    this.drawDrag();
    this.stage.controls.enabled = false;
    this.stage.canvas.setPointerCapture(event.pointerId);
    event.preventDefault();
  }

  pull(event) {
    const { held } = this;
    if (!held?.from) return;
    const to = this.stage.pointUnder(event, this.toView(held.at, held, -1));
    if (!to) return;
    const from = held.from.toArray();
    let by = this.toView(to.toArray(), held, 1).map((x, i) => x - from[i]);
    if (held.normal) {
      const along = held.normal.reduce((sum, x, i) => sum + x * by[i], 0);
      by = held.normal.map((x) => x * along);
    }
    const { state, center } = held.base;
    held.by = by;
    held.isAsked ??= false;
    held.next = this.drag === 'center' ? { state, center: center.map((x, i) => x + by[i]) } : { state, vertices: held.vertices, by };
    if (!held.isAsked) this.send(held);
  }

  /** Send the latest position, one request at a time, so that the body keeps up with the pointer. */
  async send(held) {
    held.isAsked = true;
    while (held.next) {
      const { next } = held;
      held.next = null;
      try {
        this.accept(await postJson('/body/change', next, { signal: this.latest() }));
      } catch (error) {
        this.fail(error);
      }
    }
    held.isAsked = false;
  }

  release() {
    if (!this.held) return;
    this.held = null;
    this.stage.controls.enabled = true;
    this.drawDrag();
  }

  async move(table, count) {
    const { state } = this.body;
    try {
      const thrown = await postJson('/body/throw', { state, table, count, seed: Math.floor(Math.random() * 2 ** 31) }, { signal: this.latest() });
      if (this.body.state !== state) return;
      const name = table === null ? '' : ` on ${table.replace('-', ' ')}`;
      this.stage.play(thrown.motion, () => {
        if (this.body.state !== state) return;
        const before = this.counts?.name === name ? this.counts.values : thrown.counts.map(() => 0);
        this.counts = { name, values: before.map((value, i) => value + thrown.counts[i]) };
        const total = this.counts.values.reduce((a, b) => a + b, 0);
        const often = this.body.rows.map((row, i) => [row.label, this.counts.values[i]]).filter(([, value]) => value).map(([label, value]) => `${label}: ${value}`);
        $('body-tally').textContent = `${total} ${table === null ? 'times set down' : `throw${total === 1 ? '' : 's'}${name}`}. ${often.join(', ')}.`;
        $('body-tally').hidden = false;
      });
    } catch (error) {
      this.fail(error);
    }
  }

  async showMap() {
    const { state } = this.body;
    try {
      const { svg } = await postJson('/body/map', { state });
      if (this.body.state !== state) return;
      $('map-figure').innerHTML = svg;
      $('map-legend').replaceChildren(...this.body.rows.map((row, i) => make('li', {}, chip(row.label, this.body.colors[i], this.body.texts[i]), `${(100 * row.probability).toFixed(1)} %`)));
      $('map').hidden = false;
    } catch (error) {
      this.fail(error);
    }
  }

  async save() {
    try {
      await download('/body/file', { state: this.body.state }, 'hull.stl');
    } catch (error) {
      this.fail(error);
    }
  }
}
