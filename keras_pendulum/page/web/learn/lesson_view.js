"use strict";

const LAYER_TITLES = { effort: "", value: "value max Q", error: "max Q − exact", visits: "visits" };

/** Draws a lesson: its curves, its maps, and the backup of a cell. */
class LessonView {
  constructor(lesson, task) {
    Object.assign(this, { lesson, task });
    this.layer = "effort";
    this.cell = [Math.floor(LEARNED_MAP_SIZE / 2), Math.floor(LEARNED_MAP_SIZE / 4)]; // row, column
    this.chosen = 0; // the run whose backup is shown
    this.recolour();
  }

  /** Reads the colours of the present theme. */
  recolour() {
    this.colours = readColours(this.task.maxEffort);
  }

  /** Returns the parts of the drawing, which may be done in several frames. */
  parts() {
    const { lesson } = this;
    if (this.chosen >= lesson.runs.length) this.chosen = 0;
    const layers = new Layers(this.task, this.colours, lesson.exact);
    const maps = [lesson.runs[0].last, lesson.runs[1]?.last, lesson.swept];
    const backup = lesson.backup(lesson.runs[this.chosen], this.state);
    return [
      () => this.#writeReadings(),
      ...maps.map((map, i) => () => this.#drawMap(layers, map, i, backup)),
      () => this.#writeScale(layers, maps.find(Boolean)),
      () => this.#drawBackup(backup),
      () => this.#drawReturns(),
      () => this.#drawRegrets(),
    ];
  }

  /** The state of the chosen cell; numbers before θ, such as the position of the cart, are 0. */
  get state() {
    const others = this.task.randomStart().slice(2).fill(0);
    return [...others, ...cellState(this.task, LEARNED_MAP_SIZE, ...this.cell)];
  }

  #drawReturns() {
    const { lesson, colours, task } = this;
    const ofStep = task.curveName.endsWith("step");
    const series = this.#series(({ records }) => {
      const values = records.map((each) => each.episodeReturn / (ofStep ? each.steps : 1));
      return trailingMeans(values).map((value, k) => [k + 1, value]);
    });
    const title = `${task.curveName}, mean of ${AVERAGED_EPISODES} episodes`;
    const axis = returnAxis(series, lesson.runs[0].settings.episodes, title);
    drawCurves(element("learning-curve"), colours, series, axis);
  }

  #drawRegrets() {
    const { lesson, colours } = this;
    const series = this.#series(({ regrets }) => regrets.map(({ episode, regret }) => [episode + 1, regret]));
    const title = "greedy regret: optimum − return";
    const axis = regretAxis(series, lesson.runs[0].settings.episodes, title);
    drawCurves(element("regret-curve"), colours, series, axis);
  }

  /** Returns a curve for each run. */
  #series(pointsOf) {
    const { accent, plus } = this.colours;
    return this.lesson.runs.map((run, i) => ({
      colour: i ? plus : accent,
      dashed: i > 0,
      points: pointsOf(run),
    }));
  }

  #writeReadings() {
    const { lesson } = this;
    const hasFault = lesson.runs.length > 1;
    for (const each of document.querySelectorAll("[data-faulty]")) each.hidden = !hasFault;
    lesson.runs.forEach((run, i) => {
      const last = run.records.at(-1);
      const regret = run.regrets.at(-1)?.regret;
      const texts = {
        episode: `${run.records.length}/${run.settings.episodes}`,
        updates: `${run.updates}`,
        epsilon: last ? shown(last.epsilon, 3) : "–",
        loss: last?.loss == null ? "–" : last.loss.toPrecision(2),
        regret: regret === undefined ? "–" : shown(regret, 1),
        speed: run.updatesPerSecond ? `${Math.round(run.updatesPerSecond)}` : "–",
      };
      for (const [name, text] of Object.entries(texts)) {
        document.querySelector(`[data-reading="${name}-${i}"]`).textContent = text;
      }
    });
  }

  #drawMap(layers, map, i, backup) {
    const { layer, colours, task } = this;
    const canvas = element(`learned-map-${i}`);
    if (!canvas.clientWidth) return;
    const pictureOf = (width, height) => {
      const picture = map && layers.picture(layer, map, width, height);
      return picture ?? new OffscreenCanvas(width, height);
    };
    drawPortrait(canvas, colours, task, pictureOf, map?.path ? [map.path] : []);
    if (i === this.chosen) this.#markCell(canvas, backup);
  }

  #writeScale(layers, map) {
    const { layer, lesson, task } = this;
    const [lowest, highest] = layers.ends(layer, map);
    const isCount = layer === "visits";
    const text = (value) => (isCount ? `${Math.round(Math.expm1(value))}` : shown(value, 1, layer !== "value"));
    element("scale-low").textContent = text(lowest);
    element("scale-high").textContent = `${text(highest)} ${layer === "effort" ? task.effortAxis : LAYER_TITLES[layer]}`;
    element("learned-scale").dataset.scale = layer;
    const { swept } = lesson;
    const sweeps = swept?.sweeps ? `${swept.sweeps} sweeps, ` : "";
    element("sweeps").textContent = swept ? `${sweeps}γ = ${lesson.discount}` : "computing …";
    element("sweep").firstElementChild.textContent = lesson.isSweeping ? "Stop" : "Sweep from 0";
  }

  #markCell(canvas, backup) {
    const { colours, task } = this;
    const context = canvas.getContext("2d");
    const [left, right, top, bottom] = portraitEdges(canvas.clientWidth, canvas.clientHeight);
    const point = (state) => {
      const [x, y] = placeOf(task, state.slice(-2));
      return [left + x * (right - left), top + y * (bottom - top)];
    };
    const [x, y] = point(this.state);
    const sharpness = window.devicePixelRatio || 1;
    context.setTransform(sharpness, 0, 0, sharpness, 0, 0);
    for (const [colour, width] of [[colours.halo, 5], [colours.path, 2]]) {
      context.strokeStyle = colour;
      context.lineWidth = width;
      context.strokeRect(x - 7, y - 7, 14, 14);
    }
    if (!backup) return;
    const { best, efforts } = backup;
    for (const i of new Set([0, efforts.length - 1, best])) {
      context.strokeStyle = i === best ? colours.path : `rgb(${colours.ofEffort(efforts[i])})`;
      context.lineWidth = 1.5;
      line(context, [[x, y], point(backup.steps[i].state)]);
    }
  }

  #drawBackup(backup) {
    const { lesson, colours, task } = this;
    const whose = lesson.runs.length > 1 ? ["healthy: ", "with the fault: "][this.chosen] : "";
    element("backup-text").textContent = backup
      ? whose + backup.text(task)
      : "After the first episode: choose a cell of a map.";
    for (const id of ["fan", "backup-curve"]) blank(element(id));
    if (!backup) return;
    drawFan(element("fan"), colours, task, backup);
    drawBackup(element("backup-curve"), colours, task, backup);
  }
}
